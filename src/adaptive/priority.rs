//! Computes the priority of each pixel from the maps of a filtered image: total sample counts should be
//! proportional to it.
//!
//! The priority of a pixel uses the maps of the pixels around it, not its own: a rare bright sample would draw further
//! samples that dilute it, and the image would get darker where light is rare. Variance far above that of the pixels around
//! counts in every pixel: a single firefly does not show where the next one will be.
//!
//! If a pixel contributes e/n to the relative error of the image after n samples, the total error for a given
//! number of samples is minimal for n ∝ √e. A weighted sum of the maps estimates e/n, and the priority is
//! √(n·(e/n)).

use rayon::prelude::*;

use crate::filter::{FilterResult, blur, variance_of_mean};
use crate::image::Planes;
use crate::stats::{Part, Store};

/// Weights of the maps, and constants of the priority. A weight of 0 leaves a map out.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct PrioritySettings {
    /// Weight of the variance of the filtered image.
    pub filtered_variance: f32,
    /// Weight of the variance of the unfiltered image, which is scaled to the mean of the filtered one.
    pub raw_variance: f32,
    /// Added to the weight of the filtered variance where interpolation of feature weights failed.
    pub interpolation_failure: f32,
    /// Added to the weight of the filtered variance per unit by which the residual exceeds what noise explains.
    pub residual: f32,
    /// Standard deviation of the blur of the maps, in pixels.
    pub blur: f32,
    /// Added to the squared radiance in relative errors, in units of the squared mean of the image; it limits
    /// the priority of dark pixels.
    pub epsilon: f32,
    /// Quantile to which larger priorities are clamped, so that a few pixels do not get all samples.
    pub cap_quantile: f32,
    /// Samples are placed by priority if that is expected to leave at most this fraction of the error that as many in
    /// every pixel leave (see [`expected_ratio`]): placing them takes time too.
    pub max_ratio: f32,
}

impl Default for PrioritySettings {
    fn default() -> Self {
        Self {
            filtered_variance: 1.0,
            raw_variance: 1.0,
            interpolation_failure: 0.5,
            residual: 0.3,
            blur: 3.0,
            epsilon: 0.1,
            cap_quantile: 0.995,
            max_ratio: 0.85,
        }
    }
}

/// Maximum relative variance: sums over an image are finite.
const MAX_VARIANCE: f32 = 1e20;

/// Maximum excess of the residual.
const MAX_RESIDUAL_EXCESS: f32 = 10.0;

/// Maximum ratio of a pixel's variance to the mean around it. Without it adaptive sampling left up to three times the error of uniform
/// sampling on random scenes with many fireflies.
const MAX_VARIANCE_RATIO: f32 = 30.0;

/// A filtered image and its maps.
#[derive(Clone, Copy, Debug)]
pub struct FilterMaps<'a> {
    /// Filtered image: 3 planes.
    pub image: &'a Planes,
    /// Variance of the filtered image: 3 planes.
    pub variance: &'a Planes,
    /// Squared difference of the filtered from the unfiltered image over its expected value: 1 plane, about 1
    /// where the filter is unbiased.
    pub residual: &'a Planes,
    /// Fraction of passes in which interpolation failed: 1 plane.
    pub interpolation_failure: Option<&'a Planes>,
}

impl<'a> From<&'a FilterResult> for FilterMaps<'a> {
    fn from(result: &'a FilterResult) -> Self {
        Self {
            image: &result.image,
            variance: &result.variance,
            residual: &result.residual,
            interpolation_failure: result.interpolation.as_ref().map(|found| &found.failure),
        }
    }
}

/// All that a priority depends on.
#[derive(Clone, Copy, Debug)]
struct Maps<'a> {
    /// Sample counts of the pixels.
    counts: &'a [u32],
    filtered: FilterMaps<'a>,
    /// Variance of the mean of the unfiltered image: 3 planes.
    raw_variance: &'a Planes,
}

/// Computes the priority of each pixel of a store from the maps of its filtered image; 0 at all pixels if these show no error.
pub fn priority(store: &Store, filtered: FilterMaps, settings: &PrioritySettings) -> Vec<f32> {
    let (counts, raw_variance) = (store.counts(Part::Whole), variance_of_mean(store));
    combined(Maps { counts: &counts, filtered, raw_variance: &raw_variance }, settings)
}

fn combined(Maps { counts, filtered: maps, raw_variance }: Maps, settings: &PrioritySettings) -> Vec<f32> {
    let (width, height) = (maps.image.width(), maps.image.height());
    let smooth = |plane: &[f32]| blur::gaussian_of_others(width, height, plane, settings.blur);
    // Compute the variances relative to the squared brightness
    let level = level(maps.image, settings.blur);
    let average = level.iter().map(|&v| f64::from(v)).sum::<f64>() / level.len().max(1) as f64;
    let epsilon = (f64::from(settings.epsilon) * average * average) as f32;
    let relative = |variance: &Planes| {
        let value = |i: usize| {
            let squared_level = (level[i] * level[i] + epsilon).max(f32::MIN_POSITIVE);
            (variance.channel_mean(i) / squared_level).min(MAX_VARIANCE)
        };
        let mut relative: Vec<f32> = (0..width * height).into_par_iter().map(value).collect();
        let around = smooth(&relative);
        let excess = limit_variance(&mut relative, &around);
        let mut smoothed = smooth(&relative);
        smoothed.iter_mut().for_each(|v| *v += excess);
        smoothed
    };
    let mut filtered = relative(maps.variance);
    let mut raw = relative(raw_variance);
    let scale = mean(&filtered) / mean(&raw).max(f32::MIN_POSITIVE);
    raw.iter_mut().for_each(|v| *v *= settings.raw_variance * scale);

    // Raise the filtered variance by residual and failure
    // The noise of a residual has variance 2
    let noise = (2.0 * blur::variance_factor(settings.blur).min(1.0)).sqrt();
    let limited = |&r: &f32| r.min(1.0 + MAX_RESIDUAL_EXCESS);
    let mut excess = smooth(&maps.residual.plane(0).par_iter().map(limited).collect::<Vec<_>>());
    excess.iter_mut().for_each(|r| *r = (*r - 1.0 - 2.0 * noise).max(0.0));
    let failure = maps.interpolation_failure.map(|failure| smooth(failure.plane(0)));
    filtered.par_iter_mut().enumerate().for_each(|(i, v)| {
        let failed = failure.as_ref().map_or(0.0, |failure| failure[i]);
        *v *= settings.filtered_variance
            + settings.interpolation_failure * failed
            + settings.residual * excess[i];
    });

    // Combine
    let value = |(i, &n): (usize, &u32)| ((n.max(1) as f32) * (filtered[i] + raw[i])).sqrt();
    let mut priority: Vec<f32> = counts.par_iter().enumerate().map(value).collect();
    clamp_to_quantile(&mut priority, settings.cap_quantile);
    priority
}

/// Returns the error that samples in proportion to the priorities are expected to leave, relative to that of as many
/// samples in every pixel: (Σ√e)²/(N·Σe) with the priorities √e (Neyman 1934), in (0, 1]; 1 if all are zero.
pub fn expected_ratio(priority: &[f32]) -> f64 {
    let (sum, squares) = priority.iter().fold((0.0, 0.0), |(sum, squares), &p| {
        let p = f64::from(p);
        (sum + p, squares + p * p)
    });
    if squares > 0.0 { sum * sum / (priority.len() as f64 * squares) } else { 1.0 }
}

/// Returns the mean of the channels that errors are relative to, or that of the pixels around if it is smaller: a pixel
/// that is dark beside a light counts as dark; one that is bright by noise does not count as bright.
fn level(image: &Planes, sigma: f32) -> Vec<f32> {
    let own: Vec<f32> = (0..image.pixels()).into_par_iter().map(|i| image.channel_mean(i)).collect();
    let mut around = blur::gaussian(image.width(), image.height(), &own, sigma);
    around.iter_mut().zip(&own).for_each(|(around, &own)| *around = around.min(own));
    around
}

fn mean(plane: &[f32]) -> f32 {
    (plane.iter().map(|&v| f64::from(v)).sum::<f64>() / plane.len().max(1) as f64) as f32
}

/// Limits variances to [`MAX_VARIANCE_RATIO`] times those around. Returns what that takes from their mean.
fn limit_variance(variance: &mut [f32], around: &[f32]) -> f32 {
    let before = mean(variance);
    variance.iter_mut().zip(around).for_each(|(v, around)| *v = v.min(MAX_VARIANCE_RATIO * around));
    before - mean(variance)
}

fn clamp_to_quantile(values: &mut [f32], quantile: f32) {
    if values.is_empty() {
        return;
    }
    let rank = ((values.len() - 1) as f64 * f64::from(quantile)) as usize;
    let mut sorted = values.to_vec();
    let (_, &mut bound, _) = sorted.select_nth_unstable_by(rank, f32::total_cmp);
    if bound > 0.0 {
        values.iter_mut().for_each(|v| *v = v.min(bound));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant_maps(
        width: usize,
        height: usize,
        level: f32,
        variance: impl Fn(usize, usize) -> f32,
    ) -> (Planes, Planes, Planes) {
        let mut image = Planes::new(width, height, 3);
        image.data_mut().fill(level);
        let mut v = Planes::new(width, height, 3);
        for plane in v.planes_mut() {
            plane.iter_mut().enumerate().for_each(|(i, out)| *out = variance(i % width, i / width));
        }
        let mut residual = Planes::new(width, height, 1);
        residual.data_mut().fill(1.0);
        (image, v, residual)
    }

    fn constant_priority(level: f32, variance: impl Fn(usize, usize) -> f32) -> Vec<f32> {
        let (image, v, residual) = constant_maps(64, 64, level, variance);
        let maps = Maps {
            counts: &[4; 64 * 64],
            filtered: FilterMaps {
                image: &image,
                variance: &v,
                residual: &residual,
                interpolation_failure: None,
            },
            raw_variance: &v,
        };
        combined(maps, &PrioritySettings::default())
    }

    #[test]
    fn four_times_the_variance_has_twice_the_priority() {
        let p = constant_priority(1.0, |x, _| if x < 32 { 0.01 } else { 0.04 });
        let (low, high) = (p[32 * 64 + 8], p[32 * 64 + 56]);
        assert!((high / low - 2.0).abs() < 0.02, "{low} {high}");
    }

    #[test]
    fn the_rim_of_a_light_is_judged_by_its_own_darkness() {
        let (mut image, v, residual) = constant_maps(64, 64, 5.0, |_, _| 0.01);
        image.planes_mut().for_each(|plane| (0..64).for_each(|y| plane[y * 64 + 32] = 0.05));
        let maps = Maps {
            counts: &[4; 64 * 64],
            filtered: FilterMaps {
                image: &image,
                variance: &v,
                residual: &residual,
                interpolation_failure: None,
            },
            raw_variance: &v,
        };
        let settings = PrioritySettings { cap_quantile: 1.0, epsilon: 0.05, ..PrioritySettings::default() };
        let p = combined(maps, &settings);
        assert!(p[32 * 64 + 31] > 1.8 * p[32 * 64 + 8], "{} {}", p[32 * 64 + 31], p[32 * 64 + 8]);
    }

    #[test]
    fn a_pixels_own_variance_draws_no_samples_to_it() {
        // Less than the limit
        let with_peak = |x: usize, y: usize| if (x, y) == (40, 20) { 0.29 } else { 0.01 };
        let p = constant_priority(1.0, with_peak);
        let (own, beside) = (p[20 * 64 + 40], p[20 * 64 + 41]);
        assert!(own < 0.9 * beside, "{own} {beside}");
        assert!((own / p[50 * 64 + 8] - 1.0).abs() < 1e-2, "{own} {}", p[50 * 64 + 8]);
    }

    #[test]
    fn a_single_pixels_variance_raises_all_priorities_alike() {
        let with_spike = |x: usize, y: usize| if (x, y) == (40, 20) { 50.0 } else { 0.01 };
        let [p, without] = [constant_priority(1.0, with_spike), constant_priority(1.0, |_, _| 0.01)];
        let (own, beside, far) = (p[20 * 64 + 40], p[20 * 64 + 41], p[50 * 64 + 8]);
        assert!((own / far - 1.0).abs() < 1e-2 && (beside / far - 1.0).abs() < 0.15, "{own} {beside} {far}");
        // Its excess of 50 ∕ 64² counts in every pixel.
        let expected = ((0.01 + 50.0 / 4096.0) / 0.01f32).sqrt();
        assert!((far / without[50 * 64 + 8] / expected - 1.0).abs() < 0.02, "{far} {expected}");
    }

    #[test]
    fn many_pixels_with_more_variance_raise_the_priority_around_them() {
        let p = constant_priority(1.0, |x, y| if x < 16 && (x + y) % 2 == 0 { 0.5 } else { 0.01 });
        assert!(p[32 * 64 + 8] > 4.0 * p[32 * 64 + 40], "{} {}", p[32 * 64 + 8], p[32 * 64 + 40]);
    }

    #[test]
    fn the_expected_ratio_is_that_of_samples_in_proportion_to_deviations() {
        // Deviations 1, 1, 1 and 3: (Σσ)²/(N·Σσ²) = 36/48.
        assert!((expected_ratio(&[1.0, 1.0, 1.0, 3.0]) - 0.75).abs() < 1e-12);
        assert_eq!(expected_ratio(&[2.0, 2.0]), 1.0);
        assert_eq!(expected_ratio(&[0.0, 0.0]), 1.0);
    }

    #[test]
    fn the_scale_of_radiance_does_not_matter() {
        let dark = constant_priority(1e-3, |x, _| if x < 32 { 1e-8 } else { 4e-8 });
        let bright = constant_priority(1e3, |x, _| if x < 32 { 1e4 } else { 4e4 });
        for (d, b) in dark.iter().zip(&bright) {
            assert!((d / b - 1.0).abs() < 1e-3, "{d} {b}");
        }
    }

    #[test]
    fn without_error_all_priorities_are_zero() {
        assert!(constant_priority(1.0, |_, _| 0.0).iter().all(|&p| p == 0.0));
    }

    #[test]
    fn failed_interpolation_and_residual_raise_the_priority() {
        let (image, v, mut residual) = constant_maps(64, 64, 1.0, |_, _| 0.01);
        let mut failure = Planes::new(64, 64, 1);
        (0..64 * 64).filter(|i| i % 64 >= 48).for_each(|i| failure.data_mut()[i] = 1.0);
        (0..64 * 64).filter(|i| i % 64 < 16).for_each(|i| residual.data_mut()[i] = 5.0);
        // What noise explains changes nothing.
        (0..64 * 64).filter(|i| (20..44).contains(&(i % 64))).for_each(|i| residual.data_mut()[i] = 1.2);
        let maps = Maps {
            counts: &[4; 64 * 64],
            filtered: FilterMaps {
                image: &image,
                variance: &v,
                residual: &residual,
                interpolation_failure: Some(&failure),
            },
            raw_variance: &v,
        };
        let p = combined(maps, &PrioritySettings::default());
        assert!(p[32 * 64 + 60] > 1.05 * p[32 * 64 + 32]);
        assert!(p[32 * 64 + 4] > 1.05 * p[32 * 64 + 32]);
        assert!(
            (p[32 * 64 + 32] / p[32 * 64 + 46] - 1.0).abs() < 0.05,
            "{} {}",
            p[32 * 64 + 32],
            p[32 * 64 + 46]
        );
    }

    #[test]
    fn priorities_agree_with_the_formula() {
        // Prepare maps of arbitrary values
        let (width, height, pixels) = (13, 9, 117);
        let number = |k: usize, by: usize| (k * by % 101) as f32 / 101.0;
        let planes = |count: usize, by: usize, scale: f32| {
            let mut planes = Planes::new(width, height, count);
            planes.data_mut().iter_mut().enumerate().for_each(|(k, v)| *v = scale * number(k, by));
            planes
        };
        let counts: Vec<u32> = (0..pixels).map(|i| (i * 5 % 9) as u32).collect();
        let (image, mut filtered, mut raw) = (planes(3, 37, 2.0), planes(3, 29, 0.01), planes(3, 43, 0.2));
        [&mut filtered, &mut raw].into_iter().for_each(|map| map.planes_mut().for_each(|p| p[50] = 40.0));
        let (residual, failure) = (planes(1, 31, 30.0), planes(1, 23, 1.0));
        let settings = PrioritySettings {
            filtered_variance: 0.8,
            raw_variance: 0.3,
            interpolation_failure: 0.7,
            residual: 0.2,
            blur: 1.5,
            epsilon: 0.1,
            cap_quantile: 0.9,
            max_ratio: 0.6,
        };
        let maps = Maps {
            counts: &counts,
            filtered: FilterMaps {
                image: &image,
                variance: &filtered,
                residual: &residual,
                interpolation_failure: Some(&failure),
            },
            raw_variance: &raw,
        };
        let found = combined(maps, &settings);

        // Evaluate the formula
        let smooth = |value: &dyn Fn(usize) -> f32| {
            blur::gaussian_of_others(width, height, &(0..pixels).map(value).collect::<Vec<_>>(), 1.5)
        };
        let mean = |planes: &Planes, i: usize| (0..3).map(|c| planes.plane(c)[i]).sum::<f32>() / 3.0;
        let means: Vec<f32> = (0..pixels).map(|i| mean(&image, i)).collect();
        let around = blur::gaussian(width, height, &means, 1.5);
        let level: Vec<f32> = around.iter().zip(&means).map(|(&around, &own)| around.min(own)).collect();
        let average = level.iter().sum::<f32>() / pixels as f32;
        let relative = |v: &Planes| {
            let value = |i: usize| mean(v, i) / (level[i].powi(2) + 0.1 * average * average);
            let around = smooth(&value);
            let clamped = |i: usize| value(i).min(MAX_VARIANCE_RATIO * around[i]);
            let excess = (0..pixels).map(|i| value(i) - clamped(i)).sum::<f32>() / pixels as f32;
            smooth(&clamped).into_iter().map(|v| v + excess).collect::<Vec<_>>()
        };
        let (f, r) = (relative(&filtered), relative(&raw));
        let scale = f.iter().sum::<f32>() / r.iter().sum::<f32>();
        let excess = |i: usize| (smooth(&|j| residual.data()[j].min(11.0))[i] - 1.0 - 2.0 * 0.266).max(0.0);
        let failed = smooth(&|i| failure.data()[i]);
        let expected: Vec<f32> = (0..pixels)
            .map(|i| {
                let e = f[i] * (0.8 + 0.7 * failed[i] + 0.2 * excess(i)) + 0.3 * scale * r[i];
                (counts[i].max(1) as f32 * e).sqrt()
            })
            .collect();
        let mut sorted = expected.clone();
        sorted.sort_by(f32::total_cmp);
        // The 0.9 quantile of 117 numbers.
        let most = sorted[104];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / expected.min(most) - 1.0).abs() < 1e-4, "{found} for {expected}");
        }
    }

    #[test]
    fn priorities_are_clamped_to_the_quantile_unless_it_is_zero() {
        let mut values = [5.0, 1.0, 4.0, 2.0, 3.0];
        clamp_to_quantile(&mut values, 0.5);
        assert_eq!(values, [3.0, 1.0, 3.0, 2.0, 3.0]);
        let mut mostly_none = [0.0, 0.0, 0.0, 7.0];
        clamp_to_quantile(&mut mostly_none, 0.5);
        assert_eq!(mostly_none, [0.0, 0.0, 0.0, 7.0]);
        clamp_to_quantile(&mut [], 0.5);
    }
}
