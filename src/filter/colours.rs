//! The colours a filter starts from, and what its result says about its error.

use super::blur;
use super::outliers::{self, Clamped, OutlierSettings};
use super::padded::Padded;
use super::{Filtered, LARGEST_RESIDUAL};
use crate::image::Planes;
use crate::stats::{Part, Store};

/// Deviation, in pixels, of the blur that makes the noisy estimate of squared bias usable.
const BIAS_BLUR: f32 = 4.0;

/// Variance below this share of the squared mean is rounding.
const LEAST_RELATIVE_VARIANCE: f32 = 1e-8;

/// Largest power of two by which an image is made brighter.
const MOST_STOPS: f64 = 100.0;

/// Total radiance of a store.
pub(super) struct Colours {
    counts: [Vec<u32>; 2],
    /// As rendered.
    mean: Planes,
    /// Of the samples.
    variance: Planes,
    clamped: Clamped,
    /// A power of two that brings the image's mean near 1, so that no limit in the filter depends
    /// on the scene's brightness.
    exposure: f32,
}

impl Colours {
    pub fn new(store: &Store, settings: &OutlierSettings) -> Self {
        let dims = store.layout().radiance();
        let counts = [0, 1].map(|h| store.counts(Part::Half(h)));
        let mean = store.means(Part::Whole, dims.clone());
        let variance = store.variances(Part::Whole, dims.clone());
        let mut halves = [0, 1].map(|h| store.means(Part::Half(h), dims.clone()));
        // A half without samples says nothing against the other.
        for (half, counts) in halves.iter_mut().zip(&counts) {
            for (plane, mean) in half.planes_mut().zip(mean.data().chunks(mean.pixels().max(1))) {
                for ((value, &mean), &count) in plane.iter_mut().zip(mean).zip(counts) {
                    if count == 0 {
                        *value = mean;
                    }
                }
            }
        }
        let clamped = outliers::clamp(&mean, [&halves[0], &halves[1]], [&counts[0], &counts[1]], settings);
        let values = clamped.whole.data();
        let average = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len().max(1) as f64;
        let stops = if average > 0.0 { -average.log2().round() } else { 0.0 };
        // For the faintest averages the power of two would be beyond `f32`.
        let exposure = stops.min(MOST_STOPS).exp2() as f32;
        Self { counts, mean, variance, clamped, exposure }
    }

    pub fn exposure(&self) -> f32 {
        self.exposure
    }

    /// Means and variances to measure distances by: without outliers, at the common exposure.
    pub fn guide(&self) -> [Planes; 2] {
        let mut mean = self.clamped.whole.clone();
        let mut variance = self.variance.clone();
        for outlier in &self.clamped.outliers {
            variance.planes_mut().for_each(|plane| plane[outlier.pixel] *= outlier.scale * outlier.scale);
        }
        mean.data_mut().iter_mut().for_each(|v| *v *= self.exposure);
        // One factor at a time: the square may not be a number of single precision.
        variance.data_mut().iter_mut().for_each(|v| *v = *v * self.exposure * self.exposure);
        [mean, variance]
    }

    /// Channels to average: the mean, and the difference of the halves.
    pub fn values(&self, margin: usize) -> Padded {
        let (width, height) = (self.mean.width(), self.mean.height());
        let mut values = Planes::new(width, height, 6);
        let (means, differences) = values.data_mut().split_at_mut(self.mean.data().len());
        let [a, b] = &self.clamped.halves;
        for (i, (mean, difference)) in means.iter_mut().zip(differences).enumerate() {
            *mean = self.clamped.whole.data()[i] * self.exposure;
            *difference = (a.data()[i] - b.data()[i]) * self.exposure;
        }
        Padded::from_planes(&values, margin, 0.0)
    }

    /// The image and its halves from the averaged channels, what was cut off outliers spread over
    /// the pixels that resemble them.
    pub fn finish(
        &self,
        values: &Padded,
        settings: &OutlierSettings,
        resembles: impl Fn((usize, usize), (usize, usize)) -> bool + Sync,
    ) -> [Planes; 3] {
        let values = values.to_planes();
        let pixels = values.pixels();
        let [mut image, mut a, mut b] = [0; 3].map(|_| Planes::new(values.width(), values.height(), 3));
        let (means, differences) = values.data().split_at(3 * pixels);
        for (i, (mean, difference)) in means.iter().zip(differences).enumerate() {
            let [n_a, n_b] = [0, 1].map(|h| self.counts[h][i % pixels] as f32);
            // So that the mean by counts is the image.
            let of_a = if n_a + n_b > 0.0 { n_a / (n_a + n_b) } else { 0.5 };
            let (mean, difference) = (mean / self.exposure, difference / self.exposure);
            image.data_mut()[i] = mean;
            a.data_mut()[i] = mean + (1.0 - of_a) * difference;
            b.data_mut()[i] = mean - of_a * difference;
        }
        outliers::spread(&self.clamped.outliers, &mut [&mut image, &mut a, &mut b], settings, resembles);
        [image, a, b]
    }

    /// Completes a filter's result. With F the image, c the samples' mean and v its variance:
    /// variance is ¼(F_A − F_B)², residual (F − c)² ∕ (v + variance), and error the variance plus
    /// the squared bias (F − c)² − v, blurred because it is far noisier than itself large, where
    /// that is positive.
    pub fn assess(&self, [image, a, b]: [Planes; 3]) -> Filtered {
        let (width, height, pixels) = (image.width(), image.height(), image.pixels());
        let mut variance = Planes::new(width, height, 3);
        let mut residual = Planes::new(width, height, 1);
        let mut bias = vec![0.0; pixels];
        let mut error = Planes::new(width, height, 1);
        for i in 0..3 * pixels {
            let pixel = i % pixels;
            let n = (self.counts[0][pixel] + self.counts[1][pixel]) as f32;
            let v = 0.25 * (a.data()[i] - b.data()[i]).powi(2);
            variance.data_mut()[i] = v;
            error.data_mut()[pixel] += v / 3.0;
            // The variance of less than two samples is not known: then all is as expected.
            if n < 2.0 {
                residual.data_mut()[pixel] += 1.0 / 3.0;
                continue;
            }
            let noise = self.variance.data()[i] / n;
            let mean = self.mean.data()[i];
            let squared = (image.data()[i] - mean).powi(2);
            let expected = noise + v + LEAST_RELATIVE_VARIANCE * mean * mean + f32::MIN_POSITIVE;
            residual.data_mut()[pixel] += (squared / expected).min(LARGEST_RESIDUAL) / 3.0;
            bias[pixel] += (squared - noise) / 3.0;
        }
        let bias = blur::gaussian(width, height, &bias, BIAS_BLUR);
        for (error, bias) in error.data_mut().iter_mut().zip(&bias) {
            *error += bias.max(0.0);
        }
        Filtered {
            image,
            halves: [a, b],
            interpolation_failure: None,
            interpolation_success: None,
            residual,
            variance,
            error,
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::synthetic::{store, wall};
    use super::*;
    use crate::stats::Layout;

    const WIDTH: usize = 11;
    const PIXELS: usize = WIDTH * 8;

    /// Noise of mean `level`; in column 2 are single samples, in column 5 none.
    fn noise(level: f32) -> Store {
        let layout = Layout::with_blocks(|_| false);
        let count = |x: usize, y: usize| match x {
            2 => 1,
            5 => 0,
            _ => 2 + (x + y) as u32 % 4,
        };
        store(WIDTH, 8, layout.clone(), count, |x, y, _, rng| {
            let light = level * (0.5 + rng.random::<f32>());
            wall(&layout, x, y, [light, 0.5 * light, 0.1 * light], rng)
        })
    }

    fn colours(level: f32) -> (Store, Colours) {
        let store = noise(level);
        let colours = Colours::new(&store, &OutlierSettings::off());
        (store, colours)
    }

    fn close(found: f32, expected: f32) -> bool {
        (found - expected).abs() <= 1e-5 * expected.abs()
    }

    #[test]
    fn the_exposure_is_a_power_of_two_and_scales_what_distances_are_measured_by() {
        for level in [1e-6, 0.3, 7.0, 3e5] {
            let (store, colours) = colours(level);
            let exposure = colours.exposure();
            assert_eq!(exposure.log2().fract(), 0.0);
            let mean = colours.mean.data().iter().sum::<f32>() / (3 * PIXELS) as f32;
            assert!((0.7..1.42).contains(&(mean * exposure)), "{level}: {}", mean * exposure);
            let dims = store.layout().radiance();
            let [means, variances] = colours.guide();
            let expected = [store.means(Part::Whole, dims.clone()), store.variances(Part::Whole, dims)];
            for i in 0..3 * PIXELS {
                assert!(close(means.data()[i], expected[0].data()[i] * exposure));
                assert!(close(variances.data()[i], expected[1].data()[i] * exposure * exposure));
            }
        }
        let black = Colours::new(&noise(0.0), &OutlierSettings::off());
        assert_eq!(black.exposure(), 1.0);
    }

    #[test]
    fn outliers_have_what_is_left_of_their_variance() {
        let layout = Layout::with_blocks(|_| false);
        let spiked = store(
            9,
            9,
            layout.clone(),
            |_, _| 4,
            |x, y, index, rng| {
                let light = if (x, y, index) == (4, 4, 0) { 1e4 } else { rng.random::<f32>() };
                wall(&layout, x, y, [light; 3], rng)
            },
        );
        let colours = Colours::new(&spiked, &OutlierSettings::default());
        let [outlier] = colours.clamped.outliers[..] else { panic!("one outlier") };
        let scale = outlier.scale * colours.exposure();
        let [_, variance] = colours.guide();
        assert!(close(variance.plane(1)[40], colours.variance.plane(1)[40] * scale * scale));
    }

    #[test]
    fn values_that_nothing_has_averaged_come_back_as_the_image_and_its_halves() {
        let (store, colours) = colours(0.3);
        let values = colours.values(3);
        let images = colours.finish(&values, &OutlierSettings::off(), |_, _| true);
        let dims = store.layout().radiance();
        let halves = [0, 1].map(|h| store.means(Part::Half(h), dims.clone()));
        let counts = [0, 1].map(|h| store.counts(Part::Half(h)));
        for i in 0..3 * PIXELS {
            let [image, a, b] = images.each_ref().map(|image| image.data()[i]);
            let [n_a, n_b] = counts.each_ref().map(|counts| counts[i % PIXELS] as f32);
            assert!(close(image, colours.mean.data()[i]), "{i}");
            if n_a + n_b > 0.0 {
                assert!(close((n_a * a + n_b * b) / (n_a + n_b), image), "{i}: {a} {b}");
            }
            if n_a > 0.0 && n_b > 0.0 {
                assert!((a - halves[0].data()[i]).abs() < 1e-6, "{i}: {a}");
                assert!((b - halves[1].data()[i]).abs() < 1e-6, "{i}: {b}");
            } else {
                assert!(a == image && b == image, "{i}: no second half, no difference");
            }
        }
    }

    #[test]
    fn without_samples_halves_lie_evenly_around_the_image() {
        let (_, colours) = colours(0.3);
        let mut values = Planes::new(WIDTH, 8, 6);
        values.data_mut()[..3 * PIXELS].fill(1.0);
        values.data_mut()[3 * PIXELS..].fill(0.5);
        let values = Padded::from_planes(&values, 0, 0.0);
        let [image, a, b] = colours.finish(&values, &OutlierSettings::off(), |_, _| true);
        let e = colours.exposure();
        let at = |planes: &Planes| e * planes.at(1, 5, 3);
        assert!(close(at(&image), 1.0) && close(at(&a), 1.25) && close(at(&b), 0.75));
    }

    #[test]
    fn maps_are_those_of_the_formulas() {
        let (store, colours) = colours(1.0);
        let off = |by: f32, i: usize| 1.0 + by * ((i * 37 % 19) as f32 / 19.0 - 0.5);
        let images = [0.5, 0.6, 0.7].map(|by| {
            let mut image = colours.mean.clone();
            image.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v *= off(by, i));
            image
        });
        let [image, a, b] = images.clone();
        let found = colours.assess([image, a, b]);
        let counts = store.counts(Part::Whole);
        let (mut bias, mut spread) = (vec![0.0; PIXELS], vec![0.0; PIXELS]);
        let mut residual = vec![0.0; PIXELS];
        for (i, pixel) in (0..3 * PIXELS).map(|i| (i, i % PIXELS)) {
            let [f, f_a, f_b] = images.each_ref().map(|image| image.data()[i]);
            let variance = ((f_a - f_b) / 2.0).powi(2);
            assert!(close(found.variance.data()[i], variance));
            spread[pixel] += variance / 3.0;
            if counts[pixel] < 2 {
                residual[pixel] += 1.0 / 3.0;
                continue;
            }
            let (mean, noise) = (colours.mean.data()[i], colours.variance.data()[i] / counts[pixel] as f32);
            residual[pixel] += (f - mean).powi(2) / (noise + variance + 1e-8 * mean * mean) / 3.0;
            bias[pixel] += ((f - mean).powi(2) - noise) / 3.0;
        }
        let bias = blur::gaussian(WIDTH, 8, &bias, BIAS_BLUR);
        assert!(bias.iter().any(|&b| b > 0.0) && bias.iter().any(|&b| b < 0.0));
        for i in 0..PIXELS {
            assert!((found.residual.data()[i] - residual[i]).abs() < 1e-4 * residual[i].max(1.0), "{i}");
            let expected = spread[i] + bias[i].max(0.0);
            assert!((found.error.data()[i] - expected).abs() < 1e-5, "{i}: {}", found.error.data()[i]);
        }
    }
}
