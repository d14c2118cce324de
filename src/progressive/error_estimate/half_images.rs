//! The images that a denoiser makes of each half of the samples alone, which tell the error of those whose weights follow the
//! samples.
//!
//! The filtered halves F_h and their noisy values c_h are independent of the other half's, weights included. So
//! V = ¼(F_A − F_B)² is on average the variance of their mean, and B = (F_A − c_A)(F_B − c_B) its squared bias: F_h − c_h is on
//! average the bias, since c_h has none. Both are relative to the squared image.
//!
//! * V + B is the error of the mean of both. The bias is that of half the samples: the fewer there are, the more it exceeds that
//!   of the image. Fireflies make B noisy.
//! * Differences F_h − c_h that are blurred before they are multiplied have far less noise, and miss the bias within a few
//!   pixels. The estimate is 2 V for what they miss and the variance, plus their product, which is most of the bias where light is rare.
//!
//! Both are means over an excerpt of the image. If that is not the whole image, they are multiplied by the ratio of the image's mean variance
//! to that of the excerpt.

use rayon::prelude::*;

use super::tile_means::{Mean, TileMeans};
use crate::filter::{Denoiser, FilterResult, blur};
use crate::image::Planes;
use crate::image::metrics::RELMSE_EPSILON;
use crate::progressive::excerpt::Excerpt;
use crate::stats::{Part, Store};

/// Standard deviation of the blur of the differences, in pixels.
const SIGMA: f32 = 2.0;

// Ratios of the image's error to the two means, measured for `learned` with 8 to 64 samples on our scenes and some of the
// training generator.

/// Ratio to V + B for one sample per pixel, which grows by [`SHARP_GROWTH`] up to 1.
const SHARP_RATIO: f64 = 0.46;

/// Power of the samples per pixel by which it grows.
const SHARP_GROWTH: f64 = 0.15;

/// Standard deviation of its logarithm.
const SHARP_DEVIATION: f64 = 0.3;

/// Ratio to 2 V + B of blurred differences.
const SMOOTH_RATIO: f64 = 1.05;

/// Standard deviation of its logarithm.
const SMOOTH_DEVIATION: f64 = 0.3;

/// Images of the halves of an excerpt's samples, filtered and not: 3 planes.
pub struct HalfImages {
    excerpt: Excerpt,
    filtered: [Planes; 2],
    noisy: [Planes; 2],
    /// Whether both halves of a pixel have samples.
    is_known: Vec<bool>,
    /// Samples per pixel of the whole image.
    spp: f64,
}

impl HalfImages {
    /// Filters the halves of an excerpt by `filter`, which is to do what the denoiser does. `None` if the denoiser's error is not
    /// estimated by halves, or if fewer than half of the excerpt's pixels have samples in both.
    pub fn new(
        denoiser: &dyn Denoiser,
        store: &Store,
        mut filter: impl FnMut(&Store) -> FilterResult,
    ) -> Option<Self> {
        if !denoiser.is_judged_by_halves() {
            return None;
        }
        let spp = store.spp();
        let excerpt = Excerpt::new(store.width(), store.height());
        let store = excerpt.copy_store(store);
        let [a, b] = [0, 1].map(|half| store.counts(Part::Half(half)));
        let is_known: Vec<bool> = a.iter().zip(&b).map(|(&a, &b)| a > 0 && b > 0).collect();
        if 2 * is_known.iter().filter(|&&is_known| is_known).count() < store.pixels() {
            return None;
        }
        let results = store.split_halves().map(|half| filter(&half));
        if results.iter().any(|result| result.made_by != denoiser.name()) {
            // Without its library a denoiser leaves the samples as they are
            return None;
        }
        let filtered = results.map(|result| result.image);
        let noisy = [0, 1].map(|half| store.means(Part::Half(half), store.layout().radiance()));
        Some(Self { excerpt, filtered, noisy, is_known, spp })
    }

    /// Estimates the relMSE of the image of all samples. `variance`: its variance relative to the squared image, 1 plane, and
    /// its mean over the image. Returns two estimates, each with the deviation of its logarithm beside its noise; `None` if the excerpt
    /// does not tell, since a few of its tiles have all of its variance.
    pub(super) fn estimates(
        &self,
        image: &Planes,
        variance: &Planes,
        mean_variance: Mean,
    ) -> Option<[(Mean, f64); 2]> {
        // Compute the differences, relative to the image
        let image = self.excerpt.copy_planes(image);
        let (width, height, pixels) = (image.width(), image.height(), image.pixels());
        let level = within_neighbours(&image);
        let relative = |(image, base): (&Planes, &Planes)| {
            let value = |i: usize| {
                let scale = (level.data()[i].powi(2) + RELMSE_EPSILON as f32).sqrt();
                if self.is_known[i % pixels] { (image.data()[i] - base.data()[i]) / scale } else { 0.0 }
            };
            (0..image.data().len()).into_par_iter().map(value).collect::<Vec<f32>>()
        };
        let [a, b] = &self.filtered;
        let noise = relative((a, b));
        let changes = [(a, &self.noisy[0]), (b, &self.noisy[1])].map(relative);
        let blurred = changes.each_ref().map(|change| {
            let planes = change.chunks(pixels.max(1));
            planes.flat_map(|plane| blur::gaussian(width, height, plane, SIGMA)).collect::<Vec<f32>>()
        });

        // Average variance and squared bias
        let mean_of = |[a, b]: &[Vec<f32>; 2], variance_factor: f32| {
            let error = |i: usize| variance_factor * 0.25 * noise[i].powi(2) + a[i] * b[i];
            let of_channels = |i: usize| (0..3).map(|c| f64::from(error(c * pixels + i))).sum::<f64>() / 3.0;
            TileMeans::new([width, height], of_channels, |i| self.is_known[i]).mean()
        };
        let (sharp, smooth) = (mean_of(&changes, 1.0), mean_of(&blurred, 2.0));
        let scale = self.scale(variance, mean_variance)?;
        let sharp = sharp.times((SHARP_RATIO * self.spp.max(1.0).powf(SHARP_GROWTH)).min(1.0));
        let smooth = smooth.times(SMOOTH_RATIO);
        Some([(scale(sharp), SHARP_DEVIATION), (scale(smooth), SMOOTH_DEVIATION)])
    }

    /// Returns a function that scales a mean over the excerpt to the image, by the ratio of their variances.
    fn scale(&self, variance: &Planes, whole: Mean) -> Option<impl Fn(Mean) -> Mean> {
        let part = self.excerpt.copy_planes(variance);
        let size = [part.width(), part.height()];
        let part_mean = TileMeans::new(size, |i| part.data()[i].into(), |i| self.is_known[i]).mean();
        let is_whole = part.pixels() == variance.pixels();
        if !is_whole && part_mean.value <= part_mean.standard_error {
            return None;
        }
        let ratio = if is_whole { Mean::exactly(1.0) } else { whole.over(part_mean) };
        Some(move |mean: Mean| mean.product(ratio))
    }
}

/// Limits each pixel to the range of its neighbours, channel by channel: a single wrong pixel would hide its own error.
fn within_neighbours(image: &Planes) -> Planes {
    let (width, height) = (image.width(), image.height());
    let mut limited = image.clone();
    for channel in 0..image.count() {
        let from = image.plane(channel);
        limited.plane_mut(channel).par_chunks_mut(width.max(1)).enumerate().for_each(|(y, out)| {
            for (x, out) in out.iter_mut().enumerate() {
                let rows = y.saturating_sub(1)..(y + 2).min(height);
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                let neighbours = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
                let range = neighbours.filter(|&neighbour| neighbour != (x, y)).fold(
                    (f32::INFINITY, f32::NEG_INFINITY),
                    |(least, largest), (x, y)| {
                        let value = from[y * width + x];
                        (least.min(value), largest.max(value))
                    },
                );
                if range.0 <= range.1 {
                    *out = out.clamp(range.0, range.1);
                }
            }
        });
    }
    limited
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::filter::{Cost, DenoiserName, Reads, SampleVectors, unfiltered};
    use crate::stats::Layout;

    /// The mean of those of 7×7 pixels that hardly differ from the pixel: its weights follow the noise.
    struct RangeFilter;

    impl Denoiser for RangeFilter {
        fn name(&self) -> DenoiserName {
            DenoiserName { method: "range", preset: None }
        }

        fn summary(&self) -> &'static str {
            "The mean of similar pixels"
        }

        fn reads(&self) -> Reads {
            Reads { blocks: &[], sample_vectors: SampleVectors::None }
        }

        fn cost(&self) -> Cost {
            Cost { core_seconds: 0.0, bytes: 0, pass_time: 1.0, is_per_sample: false }
        }

        fn stand_in(&self) -> &'static dyn Denoiser {
            &RangeFilter
        }

        fn is_judged_by_halves(&self) -> bool {
            true
        }

        fn filter(&self, store: &Store, _: u64) -> FilterResult {
            let noisy = unfiltered(store);
            let (width, height) = (store.width(), store.height());
            let mut image = noisy.image.clone();
            for (channel, plane) in image.planes_mut().enumerate() {
                for (i, value) in plane.iter_mut().enumerate() {
                    let (x, y) = (i % width, i / width);
                    let rows = y.saturating_sub(3)..(y + 4).min(height);
                    let near =
                        rows.flat_map(|y| (x.saturating_sub(3)..(x + 4).min(width)).map(move |x| (x, y)));
                    let values = near.map(|(x, y)| noisy.image.at(channel, x, y));
                    let similar: Vec<f32> = values.filter(|v| (v - *value).abs() < 0.2).collect();
                    *value = similar.iter().sum::<f32>() / similar.len() as f32;
                }
            }
            FilterResult { image, made_by: self.name(), ..noisy }
        }
    }

    #[test]
    fn variance_and_squared_bias_of_the_halves_add_up_to_the_error_of_their_mean() {
        // Light and dark stripes
        const SIDE: usize = 160;
        let truth = |x: usize| if (x / 5).is_multiple_of(2) { 0.4 } else { 0.8 };
        let layout = Layout::with_blocks(|_| false);
        let sample = |x: usize, y: usize, _: u32, rng: &mut rand_pcg::Pcg32| {
            wall(&layout, x, y, [2.0 * truth(x) * rng.random::<f32>(); 3], rng)
        };
        let store = store(SIDE, SIDE, layout.clone(), |_, _| 16, sample);
        let halves = HalfImages::new(&RangeFilter, &store, |half| RangeFilter.filter(half, 0)).unwrap();

        // Compute the true error of the mean of both images, relative to the truth
        let [a, b] = &halves.filtered;
        let mut exact = a.clone();
        exact.data_mut().iter_mut().enumerate().for_each(|(i, value)| *value = truth(i % SIDE));
        let error = |i: usize| {
            let mean = 0.5 * (a.data()[i] + b.data()[i]);
            f64::from((mean - exact.data()[i]).powi(2))
                / (f64::from(exact.data()[i]).powi(2) + RELMSE_EPSILON)
        };
        let expected = (0..a.data().len()).map(error).sum::<f64>() / a.data().len() as f64;

        let mut variance = Planes::new(SIDE, SIDE, 1);
        variance.data_mut().fill(1.0);
        let [(sharp, _), _] = halves.estimates(&exact, &variance, Mean::exactly(1.0)).unwrap();
        let found = sharp.value / (SHARP_RATIO * 16f64.powf(SHARP_GROWTH));
        assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
    }

    #[test]
    fn an_excerpt_that_misses_the_noise_gives_no_estimate() {
        // Noise everywhere, and in the middle of the image alone, between the cells
        let (width, height) = (400, 300);
        let layout = Layout::with_blocks(|_| false);
        let is_central = |x: usize, y: usize| x.abs_diff(width / 2) < 8 && y.abs_diff(height / 2) < 6;
        for is_everywhere in [true, false] {
            let has_noise = |x: usize, y: usize| is_everywhere || is_central(x, y);
            let sample = |x: usize, y: usize, _: u32, rng: &mut rand_pcg::Pcg32| {
                let light = if has_noise(x, y) { rng.random() } else { 0.5 };
                wall(&layout, x, y, [light; 3], rng)
            };
            let store = store(width, height, layout.clone(), |_, _| 4, sample);
            let halves = HalfImages::new(&RangeFilter, &store, |half| RangeFilter.filter(half, 0)).unwrap();
            let mut variance = Planes::new(width, height, 1);
            for (i, value) in variance.data_mut().iter_mut().enumerate() {
                *value = if has_noise(i % width, i / width) { 0.01 } else { 0.0 };
            }
            let whole = TileMeans::new([width, height], |i| variance.data()[i].into(), |_| true).mean();
            let estimates = halves.estimates(&RangeFilter.filter(&store, 0).image, &variance, whole);
            assert_eq!(estimates.is_some(), is_everywhere);
            for (mean, _) in estimates.into_iter().flatten() {
                assert!(mean.value > 0.0 && mean.value.is_finite(), "{mean:?}");
            }
        }
    }

    #[test]
    fn a_single_pixel_is_limited_and_an_edge_is_not() {
        let mut image = Planes::new(5, 4, 1);
        image.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = if i % 5 < 2 { 1.0 } else { 3.0 });
        assert_eq!(within_neighbours(&image), image);
        let mut wrong = image.clone();
        wrong.row_mut(0, 2)[3] = 100.0;
        assert_eq!(within_neighbours(&wrong), image);
        let single = Planes::new(1, 1, 3);
        assert_eq!(within_neighbours(&single), single);
    }
}
