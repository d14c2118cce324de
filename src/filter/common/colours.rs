//! The colours that P-RPF and RPF filter: clamped, normalised to a common brightness and, after the filter,
//! restored and assessed.
//!
//! Takes the radiance of a store. Filters average six channels, the mean of all samples and the difference of
//! the halves, from which the image of each half follows.

use rayon::prelude::*;

use super::error_maps::ErrorMaps;
use super::fireflies::{self, FireflyClamp, FireflySettings};
use super::firefly_redistribution::redistribute;
use super::interleaved_planes::InterleavedPlanes;
use crate::filter::denoiser_name::DenoiserName;
use crate::filter::result::{FilterResult, Reliability};
use crate::image::Planes;
use crate::stats::{Part, Store};

/// Maximum of the logarithm of the normalisation scale.
const MAX_LOG_SCALE: f64 = 100.0;

/// Radiance of a store, directly visible emission included.
pub struct Colours {
    counts: [Vec<u32>; 2],
    /// Mean of the samples.
    mean: Planes,
    /// Variance of the samples.
    variance: Planes,
    clamped: FireflyClamp,
    /// A power of two that scales the image's mean to about 1, so that the filter does not depend on the
    /// scene's brightness.
    normalisation_scale: f32,
}

impl Colours {
    pub fn new(store: &Store, settings: &FireflySettings) -> Self {
        let dims = store.layout().radiance();
        let counts = [0, 1].map(|h| store.counts(Part::Half(h)));
        let mean = store.means(Part::Whole, dims.clone());
        let variance = store.variances(Part::Whole, dims.clone());
        let mut halves = [0, 1].map(|h| store.means(Part::Half(h), dims.clone()));
        // A half without samples gets the mean of all
        for (half, counts) in halves.iter_mut().zip(&counts) {
            for (plane, mean) in half.planes_mut().zip(mean.data().chunks(mean.pixels().max(1))) {
                for ((value, &mean), &count) in plane.iter_mut().zip(mean).zip(counts) {
                    if count == 0 {
                        *value = mean;
                    }
                }
            }
        }
        let clamped = fireflies::clamp(&mean, [&halves[0], &halves[1]], [&counts[0], &counts[1]], settings);
        let values = clamped.whole.data();
        let average = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len().max(1) as f64;
        let log_scale = if average > 0.0 { -average.log2().round() } else { 0.0 };
        // The scale of the darkest images would exceed `f32`.
        let normalisation_scale = log_scale.min(MAX_LOG_SCALE).exp2() as f32;
        Self { counts, mean, variance, clamped, normalisation_scale }
    }

    pub fn normalisation_scale(&self) -> f32 {
        self.normalisation_scale
    }

    /// Returns the clamped and normalised means and sample variances, with which distances are measured: 3
    /// planes each.
    pub fn guide(&self) -> [Planes; 2] {
        let mut mean = self.clamped.whole.clone();
        let mut variance = self.variance.clone();
        for firefly in &self.clamped.fireflies {
            variance.planes_mut().for_each(|plane| plane[firefly.pixel] *= firefly.scale * firefly.scale);
        }
        mean.data_mut().iter_mut().for_each(|v| *v *= self.normalisation_scale);
        // The square of the scale may exceed `f32`.
        variance
            .data_mut()
            .iter_mut()
            .for_each(|v| *v = *v * self.normalisation_scale * self.normalisation_scale);
        [mean, variance]
    }

    /// Returns the channels to filter: the normalised mean and the difference of the halves, 3 planes each.
    pub fn values(&self, margin: usize) -> InterleavedPlanes {
        let (width, height) = (self.mean.width(), self.mean.height());
        let mut values = Planes::new(width, height, 6);
        let (means, differences) = values.data_mut().split_at_mut(self.mean.data().len());
        let [a, b] = &self.clamped.halves;
        for (i, (mean, difference)) in means.iter_mut().zip(differences).enumerate() {
            *mean = self.clamped.whole.data()[i] * self.normalisation_scale;
            *difference = (a.data()[i] - b.data()[i]) * self.normalisation_scale;
        }
        InterleavedPlanes::from_planes(&values, margin, 0.0)
    }

    /// Restores image and halves from the filtered channels, and redistributes the excess of fireflies to
    /// similar pixels.
    pub fn finish(
        &self,
        values: &InterleavedPlanes,
        settings: &FireflySettings,
        is_similar: impl Fn((usize, usize), (usize, usize)) -> bool + Sync,
    ) -> [Planes; 3] {
        let (width, height) = (values.width(), values.height());
        let [mut image, mut a, mut b] = [0; 3].map(|_| Planes::new(width, height, 3));
        let planes = image.planes_mut().zip(a.planes_mut()).zip(b.planes_mut());
        for (channel, ((image, a), b)) in planes.enumerate() {
            let [image, a, b] = [image, a, b].map(|plane| plane.par_chunks_mut(width.max(1)));
            image.zip(a).zip(b).enumerate().for_each(|(y, ((image, a), b))| {
                let (means, differences) = (values.row(channel, y), values.row(3 + channel, y));
                for x in 0..width {
                    let [n_a, n_b] = [0, 1].map(|h| self.counts[h][y * width + x] as f32);
                    // The mean of the halves, weighted by sample counts, is the image.
                    let fraction_a = if n_a + n_b > 0.0 { n_a / (n_a + n_b) } else { 0.5 };
                    let [mean, difference] =
                        [means[x], differences[x]].map(|value| value / self.normalisation_scale);
                    image[x] = mean;
                    a[x] = mean + (1.0 - fraction_a) * difference;
                    b[x] = mean - fraction_a * difference;
                }
            });
        }
        redistribute(&self.clamped.fireflies, &mut [&mut image, &mut a, &mut b], settings, is_similar);
        [image, a, b]
    }

    /// Returns the result of a filter with its error maps.
    pub fn assess(&self, made_by: DenoiserName, [image, a, b]: [Planes; 3]) -> FilterResult {
        let counts = [self.counts[0].as_slice(), &self.counts[1]];
        let noisy = self.clamped.halves.each_ref();
        let maps = ErrorMaps::self_filtered(&image, [&a, &b], &self.mean, &self.variance, noisy, counts);
        FilterResult::with_maps(made_by, image, [a, b], maps, Reliability::SELF_FILTERED)
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::filter::common::blur;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::Layout;

    const WIDTH: usize = 11;
    const PIXELS: usize = WIDTH * 8;

    /// Noise of mean `level`, with single samples in column 2 and none in column 5.
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
        let colours = Colours::new(&store, &FireflySettings::off());
        (store, colours)
    }

    fn close(found: f32, expected: f32) -> bool {
        (found - expected).abs() <= 1e-5 * expected.abs()
    }

    #[test]
    fn the_scale_is_a_power_of_two_and_applies_to_means_and_variances() {
        for level in [1e-6, 0.3, 7.0, 3e5] {
            let (store, colours) = colours(level);
            let scale = colours.normalisation_scale();
            assert_eq!(scale.log2().fract(), 0.0);
            let mean = colours.mean.data().iter().sum::<f32>() / (3 * PIXELS) as f32;
            assert!((0.7..1.42).contains(&(mean * scale)), "{level}: {}", mean * scale);
            let dims = store.layout().radiance();
            let [means, variances] = colours.guide();
            let expected = [store.means(Part::Whole, dims.clone()), store.variances(Part::Whole, dims)];
            for i in 0..3 * PIXELS {
                assert!(close(means.data()[i], expected[0].data()[i] * scale));
                assert!(close(variances.data()[i], expected[1].data()[i] * scale * scale));
            }
        }
        let black = Colours::new(&noise(0.0), &FireflySettings::off());
        assert_eq!(black.normalisation_scale(), 1.0);
    }

    #[test]
    fn variances_of_fireflies_are_scaled() {
        let layout = Layout::with_blocks(|_| false);
        let with_firefly = store(
            9,
            9,
            layout.clone(),
            |_, _| 4,
            |x, y, index, rng| {
                let light = if (x, y, index) == (4, 4, 0) { 1e4 } else { rng.random::<f32>() };
                wall(&layout, x, y, [light; 3], rng)
            },
        );
        let colours = Colours::new(&with_firefly, &FireflySettings::default());
        let [firefly] = colours.clamped.fireflies[..] else { panic!("one firefly") };
        let scale = firefly.scale * colours.normalisation_scale();
        let [_, variance] = colours.guide();
        assert!(close(variance.plane(1)[40], colours.variance.plane(1)[40] * scale * scale));
    }

    #[test]
    fn unfiltered_channels_are_restored_to_the_image_and_its_halves() {
        let (store, colours) = colours(0.3);
        let values = colours.values(3);
        let images = colours.finish(&values, &FireflySettings::off(), |_, _| true);
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
                assert!(a == image && b == image, "{i}: there is no second half");
            }
        }
    }

    #[test]
    fn without_samples_the_halves_lie_evenly_around_the_image() {
        let (_, colours) = colours(0.3);
        let mut values = Planes::new(WIDTH, 8, 6);
        values.data_mut()[..3 * PIXELS].fill(1.0);
        values.data_mut()[3 * PIXELS..].fill(0.5);
        let values = InterleavedPlanes::from_planes(&values, 0, 0.0);
        let [image, a, b] = colours.finish(&values, &FireflySettings::off(), |_, _| true);
        let e = colours.normalisation_scale();
        let at = |planes: &Planes| e * planes.at(1, 5, 3);
        assert!(close(at(&image), 1.0) && close(at(&a), 1.25) && close(at(&b), 0.75));
    }

    #[test]
    fn maps_agree_with_the_formulas() {
        let (store, colours) = colours(1.0);
        let off = |by: f32, i: usize| 1.0 + by * ((i * 37 % 19) as f32 / 19.0 - 0.5);
        // Images of large bias and of large variance
        for (deviations, is_biased) in [([1.5, 1.6, 1.7], true), ([0.1, 1.5, -1.5], false)] {
            let images = deviations.map(|by| {
                let mut image = colours.mean.clone();
                image.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v *= off(by, i));
                image
            });
            let [image, a, b] = images.clone();
            let found = colours.assess(DenoiserName { method: "prpf", preset: None }, [image, a, b]);
            let counts = store.counts(Part::Whole);
            let (mut risk, mut spread) = (vec![0.0; PIXELS], vec![0.0; PIXELS]);
            let halves = [0, 1].map(|h| store.means(Part::Half(h), store.layout().radiance()));
            let half_counts = [0, 1].map(|h| store.counts(Part::Half(h)));
            let mut residual = vec![0.0; PIXELS];
            for (i, pixel) in (0..3 * PIXELS).map(|i| (i, i % PIXELS)) {
                let [f, f_a, f_b] = images.each_ref().map(|image| image.data()[i]);
                let variance = ((f_a - f_b) / 2.0).powi(2);
                assert!(close(found.variance.data()[i], variance));
                spread[pixel] += variance / 3.0;
                let [n_a, n_b] = half_counts.each_ref().map(|n| n[pixel] as f32);
                if n_a > 0.0 && n_b > 0.0 {
                    let (p, q) = (n_a / (n_a + n_b), n_b / (n_a + n_b));
                    let [c_a, c_b] = halves.each_ref().map(|half| half.data()[i]);
                    let d = (c_a - c_b).powi(2);
                    let r = p * ((f_a - c_b).powi(2) - p * d) + q * ((f_b - c_a).powi(2) - q * d);
                    risk[pixel] += (r - 4.0 * p * q * variance) / 3.0;
                }
                if counts[pixel] < 2 {
                    residual[pixel] += 1.0 / 3.0;
                    continue;
                }
                let (mean, noise) =
                    (colours.mean.data()[i], colours.variance.data()[i] / counts[pixel] as f32);
                residual[pixel] += (f - mean).powi(2) / (noise + variance + 1e-8 * mean * mean) / 3.0;
            }
            let [risk, spread] = [risk, spread].map(|plane| blur::gaussian(WIDTH, 8, &plane, 4.0));
            assert_eq!(risk.iter().zip(&spread).any(|(r, s)| r > s), is_biased);
            for i in 0..PIXELS {
                assert!((found.residual.data()[i] - residual[i]).abs() < 1e-4 * residual[i].max(1.0), "{i}");
                let expected = spread[i].max(risk[i]);
                assert!((found.error.data()[i] - expected).abs() < 1e-5, "{i}: {}", found.error.data()[i]);
            }
        }
    }
}
