//! Pixel-based random parameter filtering (Park, Moon, Kim and Yoon, *P-RPF: pixel-based random
//! parameter filtering for Monte Carlo rendering*), the published method: Algorithm 1.
//!
//! Means and deviations of pixels take the place of samples. What the paper leaves open is decided
//! so: distances and mutual information use the original statistics in all passes, only the
//! averaged values move; Eq. 4 has the bandwidth of random parameter filtering (Sen and Darabi
//! 2012), see [`Gain`]; only pixels that resemble the centre are averaged; outliers are clamped
//! before the first pass.

use super::Filtered;
use super::bilateral;
use super::colours::Colours;
use super::neighbourhood::{Guide, Neighbourhood};
use super::outliers::OutlierSettings;
use super::padded::{LANES, Padded};
use super::stages::{Observer, Stage};
use super::upsampling;
use super::weights::{self, Evidence};
use crate::image::Planes;
use crate::stats::Store;

/// Reading of Eq. 4: what squared differences are measured by.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub enum Gain {
    /// As in random parameter filtering: by the neighbourhood's variance times 8 σ₈² ∕ n, wider
    /// the more of the colour is random. The film deviation is a quarter of the window.
    RpfSigma {
        /// 0.002; for path-traced indoor scenes 0.02.
        sigma8_squared: f32,
    },
    /// By the variance of the pixel's own mean: does not blur what is certain. The film deviation
    /// is a twelfth of the window.
    OwnVariance {
        /// Bandwidth, in variances; 8 equals the literal formula at 8 samples.
        kappa: f32,
        /// Share of the neighbourhood's variance that is added.
        rho: f32,
    },
}

/// Constants of the method.
#[derive(Clone, Debug, serde::Serialize)]
pub struct PrpfSettings {
    /// Sides of the windows, pass by pass, in pixels. Paper: 55, 35, 17, 7.
    pub windows: Vec<usize>,
    /// Deviations that a cluster's normals and albedos may be apart. Paper: 3.
    pub z: f32,
    /// The same for world positions. Paper: 30.
    pub z_world: f32,
    /// Normals and albedos that vary less than this within a pixel may always be this far apart.
    /// Random parameter filtering: 0.1.
    pub tolerance: f32,
    /// The same for world positions, which are of order 1.
    pub tolerance_world: f32,
    pub gain: Gain,
    /// How much stronger randomness counts with each pass. Paper: 0.1.
    pub randomness_growth: f32,
    /// How much stronger randomness counts for colours than for features. Paper: 2.
    pub colour_damping: f32,
    /// Pixels from one node of the sparse grid to the next, along both axes. Paper: 5.
    pub grid_spacing: usize,
    /// Sum of weights at or below which interpolation fails. Paper: 0.1.
    pub interpolation_threshold: f32,
    /// Interpolate weights between the nodes; otherwise compute them at every pixel.
    pub upsampling: bool,
    /// Samples that mutual information is measured on, at most. Paper: all of the neighbourhood. 8192 are
    /// nearly that; against them 2048 change the error of the image by 1 to 20 %, 512 by 1 to 60 %.
    pub mi_samples: usize,
    /// Columns and rows of a window, at most, that a neighbourhood's statistics are taken from.
    /// Paper: all of them; 9 give deviations within some 8 %.
    pub statistics_side: usize,
    pub outliers: OutlierSettings,
}

impl PrpfSettings {
    /// The published method.
    pub fn paper() -> Self {
        Self {
            windows: vec![55, 35, 17, 7],
            z: 3.0,
            z_world: 30.0,
            tolerance: 0.1,
            tolerance_world: 0.001,
            gain: Gain::RpfSigma { sigma8_squared: 0.002 },
            randomness_growth: 0.1,
            colour_damping: 2.0,
            grid_spacing: 5,
            interpolation_threshold: 0.1,
            upsampling: true,
            mi_samples: 2048,
            statistics_side: 9,
            outliers: OutlierSettings::default(),
        }
    }

    /// Pixels that are read to each side of the image: as far as the largest window reaches, and as many
    /// as are looked at together from any pixel on.
    pub(super) fn margin(&self) -> usize {
        self.windows.iter().max().map_or(0, |window| window / 2).max(LANES - 1)
    }
}

/// Filters a store's image. Deterministic in `seed`, whatever the number of threads.
pub fn filter(store: &Store, settings: &PrpfSettings, seed: u64) -> Filtered {
    filter_observed(store, settings, seed, &|_| ())
}

/// The same, `observe` being told of each stage that begins.
pub fn filter_observed(store: &Store, settings: &PrpfSettings, seed: u64, observe: Observer) -> Filtered {
    observe(Stage::Other);
    let colours = Colours::new(store, &settings.outliers);
    observe(Stage::Neighbourhoods);
    let guide = Guide::new(store, colours.guide(), settings);
    let mut values = colours.values(settings.margin());
    let mut interpolation = Interpolation::new(store);

    for (pass, &window) in settings.windows.iter().enumerate() {
        observe(Stage::Neighbourhoods);
        let neighbourhood = Neighbourhood::new(&guide, window, settings.statistics_side);
        let exposure = colours.exposure();
        let evidence = Evidence {
            store,
            guide: &guide,
            neighbourhood: &neighbourhood,
            exposure,
            settings,
            pass,
            window,
            seed,
        };
        observe(Stage::Weights);
        let weights = upsampling::weights(&evidence);
        observe(Stage::Filtering);
        values = bilateral::filter(&values, &guide, &neighbourhood, &weights, window, settings.gain);
        interpolation.add(&weights, settings);
    }

    observe(Stage::Other);
    let images = colours.finish(&values, &settings.outliers, |i, j| guide.resembles(i, j));
    let mut filtered = colours.assess(images);
    if settings.upsampling {
        let (failure, success) = interpolation.finish();
        filtered.interpolation_failure = Some(failure);
        filtered.interpolation_success = Some(success);
    }
    filtered
}

/// The weights that [`filter`] uses: their names, and for each pass a plane for each of them.
pub fn feature_weights(store: &Store, settings: &PrpfSettings, seed: u64) -> (Vec<String>, Vec<Planes>) {
    let colours = Colours::new(store, &settings.outliers);
    let guide = Guide::new(store, colours.guide(), settings);
    let exposure = colours.exposure();
    let of_pass = |(pass, &window): (usize, &usize)| {
        let neighbourhood = &Neighbourhood::new(&guide, window, settings.statistics_side);
        let guide = &guide;
        let evidence = Evidence { store, guide, neighbourhood, exposure, settings, pass, window, seed };
        upsampling::weights(&evidence).to_planes()
    };
    let mut names = weights::names(store.layout());
    names.push("interpolation".to_owned());
    (names, settings.windows.iter().enumerate().map(of_pass).collect())
}

/// Where interpolation of feature weights between grid nodes fails (1; elsewhere 0), and the share
/// of pixels between nodes where it does not: the sparse-grid stage alone, for one window. It needs
/// no mutual information, and so neither a reservoir nor random numbers.
pub fn interpolation_failure(store: &Store, settings: &PrpfSettings, window: usize) -> (Planes, f32) {
    let settings = &PrpfSettings { windows: vec![window], ..settings.clone() };
    let colours = Colours::new(store, &settings.outliers);
    let guide = Guide::new(store, colours.guide(), settings);
    let mut interpolation = Interpolation::new(store);
    let neighbourhood = Neighbourhood::new(&guide, window, settings.statistics_side);
    interpolation.add(&upsampling::confidence(&guide, &neighbourhood, window, settings), settings);
    interpolation.finish()
}

/// Failures and successes of interpolation over passes.
struct Interpolation {
    failures: Planes,
    passes: usize,
    between: usize,
    interpolated: usize,
}

impl Interpolation {
    fn new(store: &Store) -> Self {
        Self {
            failures: Planes::new(store.width(), store.height(), 1),
            passes: 0,
            between: 0,
            interpolated: 0,
        }
    }

    /// Takes in the sums of interpolation weights: the last plane, infinite at nodes.
    fn add(&mut self, weights: &Padded, settings: &PrpfSettings) {
        self.passes += 1;
        let width = weights.width().max(1);
        for (y, failures) in self.failures.data_mut().chunks_mut(width).enumerate() {
            for (failure, &sum) in failures.iter_mut().zip(weights.row(weights.count() - 1, y)) {
                let failed = sum <= settings.interpolation_threshold;
                *failure += f32::from(failed);
                self.between += usize::from(sum.is_finite());
                self.interpolated += usize::from(sum.is_finite() && !failed);
            }
        }
    }

    /// Averages over passes. Where there is nothing between nodes, nothing has failed.
    fn finish(mut self) -> (Planes, f32) {
        self.failures.data_mut().iter_mut().for_each(|f| *f /= self.passes.max(1) as f32);
        let success = if self.between > 0 { self.interpolated as f32 / self.between as f32 } else { 1.0 };
        (self.failures, success)
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::synthetic::{store, wall};
    use super::*;
    use crate::stats::{Block, Layout};

    fn everything() -> Layout {
        Layout::with_blocks(|_| true)
    }

    /// A wall lit with noise of mean `colour`.
    fn noisy_wall(
        width: usize,
        height: usize,
        colour: f32,
        count: impl Fn(usize, usize) -> u32 + Sync,
    ) -> Store {
        let layout = everything();
        store(width, height, layout.clone(), count, |x, y, _, rng| {
            let light = 2.0 * colour * rng.random::<f32>();
            wall(&layout, x, y, [light, 0.7 * light, 0.3 * light], rng)
        })
    }

    fn largest_difference(a: &Planes, b: &Planes) -> f32 {
        assert_eq!(a.data().len(), b.data().len());
        a.data().iter().zip(b.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    fn assert_finite(filtered: &Filtered) {
        let Filtered { image, halves: [a, b], residual, variance, error, .. } = filtered;
        for planes in [image, a, b, residual, variance, error] {
            assert!(planes.data().iter().all(|v| v.is_finite()));
        }
    }

    #[test]
    fn a_black_image_stays_black() {
        let layout = everything();
        let store =
            store(20, 13, layout.clone(), |_, _| 8, |x, y, _, rng| wall(&layout, x, y, [0.0; 3], rng));
        let filtered = filter(&store, &PrpfSettings::paper(), 1);
        assert!(filtered.image.data().iter().all(|&v| v == 0.0));
        assert!(filtered.error.data().iter().all(|&v| v == 0.0));
        assert_finite(&filtered);
    }

    #[test]
    fn an_image_of_one_colour_stays_so_to_the_last_bit() {
        let layout = everything();
        let colour = [0.3, 0.123, 7.7];
        let store = store(20, 13, layout.clone(), |_, _| 8, |x, y, _, rng| wall(&layout, x, y, colour, rng));
        let filtered = filter(&store, &PrpfSettings::paper(), 1);
        for (k, colour) in colour.iter().enumerate() {
            assert!(filtered.image.plane(k).iter().all(|v| v == colour));
        }
        assert!(filtered.variance.data().iter().all(|&v| v == 0.0));
    }

    #[test]
    fn radiance_scales_the_result_and_nothing_else() {
        let settings = PrpfSettings::paper();
        let reference = filter(&noisy_wall(40, 30, 1.0, |_, _| 8), &settings, 1).image;
        for scale in [1e-6, 1e6] {
            let mut image = filter(&noisy_wall(40, 30, scale, |_, _| 8), &settings, 1).image;
            image.data_mut().iter_mut().for_each(|v| *v /= scale);
            let difference = largest_difference(&reference, &image);
            assert!(difference < 1e-3, "{scale}: {difference}");
        }
    }

    #[test]
    fn every_size_is_filtered() {
        for (width, height) in [(1, 1), (1, 40), (33, 1), (2, 2), (6, 11), (17, 5)] {
            let filtered = filter(&noisy_wall(width, height, 1.0, |_, _| 4), &PrpfSettings::paper(), 1);
            assert_eq!((filtered.image.width(), filtered.image.height()), (width, height));
            assert_finite(&filtered);
            assert!(filtered.image.plane(0).iter().all(|&v| v > 0.2 && v < 2.0), "{width}x{height}");
        }
        assert!(filter(&noisy_wall(0, 0, 1.0, |_, _| 4), &PrpfSettings::paper(), 1).image.data().is_empty());
    }

    #[test]
    fn windows_of_any_size_are_filtered() {
        for windows in [vec![7], vec![17, 7], vec![1], vec![3, 71]] {
            let settings = PrpfSettings { windows, ..PrpfSettings::paper() };
            for width in [14, 26, 33] {
                assert_finite(&filter(&noisy_wall(width, 20, 1.0, |_, _| 4), &settings, 1));
            }
        }
    }

    #[test]
    fn noise_on_a_wall_goes_and_its_mean_stays() {
        let store = noisy_wall(64, 64, 1.0, |_, _| 8);
        let filtered = filter(&store, &PrpfSettings::paper(), 1);
        let deviation = |planes: &Planes| {
            let plane = planes.plane(0);
            (plane.iter().map(|v| (v - 1.0).powi(2)).sum::<f32>() / plane.len() as f32).sqrt()
        };
        let before = deviation(&store.means(crate::stats::Part::Whole, store.layout().radiance()));
        let after = deviation(&filtered.image);
        assert!(after < before / 5.0, "{before} {after}");
    }

    #[test]
    fn the_image_is_the_mean_of_its_halves_by_counts() {
        let store = noisy_wall(30, 30, 1.0, |x, y| 1 + (x * y % 7) as u32);
        let filtered = filter(&store, &PrpfSettings::paper(), 1);
        let counts = [0, 1].map(|h| store.counts(crate::stats::Part::Half(h)));
        for i in 0..900 {
            let [a, b] = counts.each_ref().map(|counts| counts[i] as f32);
            let [of_a, of_b] = filtered.halves.each_ref().map(|half| half.data()[i]);
            let mean = (a * of_a + b * of_b) / (a + b);
            assert!((mean - filtered.image.data()[i]).abs() < 1e-5);
        }
    }

    #[test]
    fn pixels_without_samples_are_filled_from_their_neighbours() {
        let store = noisy_wall(40, 40, 1.0, |x, y| if (x + y) % 5 == 0 { 0 } else { 8 });
        let filtered = filter(&store, &PrpfSettings::paper(), 1);
        assert_finite(&filtered);
        assert!(filtered.image.plane(0).iter().all(|&v| v > 0.7 && v < 1.3));
        let none = filter(&noisy_wall(9, 9, 1.0, |_, _| 0), &PrpfSettings::paper(), 1);
        assert!(none.image.data().iter().all(|&v| v == 0.0));
        assert_finite(&none);
    }

    #[test]
    fn one_sample_a_pixel_is_enough_for_an_image() {
        let filtered = filter(&noisy_wall(40, 40, 1.0, |_, _| 1), &PrpfSettings::paper(), 1);
        assert_finite(&filtered);
        assert!(filtered.image.plane(0).iter().all(|&v| v > 0.6 && v < 1.4));
    }

    #[test]
    fn interpolation_succeeds_everywhere_on_a_wall_and_agrees_with_direct_weights() {
        let layout = everything();
        let paper = PrpfSettings::paper();
        let even = store(60, 60, layout.clone(), |_, _| 8, |x, y, _, rng| wall(&layout, x, y, [1.0; 3], rng));
        for window in [55, 35, 17, 7] {
            assert_eq!(interpolation_failure(&even, &paper, window).1, 1.0);
        }
        let store = noisy_wall(60, 60, 1.0, |_, _| 8);
        let interpolated = filter(&store, &paper, 1);
        assert!(interpolated.interpolation_success.is_some_and(|share| share > 0.999));
        let direct = filter(&store, &PrpfSettings { upsampling: false, ..paper }, 1);
        assert!(direct.interpolation_failure.is_none());
        let difference = largest_difference(&interpolated.image, &direct.image);
        assert!(difference < 0.02, "{difference}");
    }

    #[test]
    fn interpolation_fails_everywhere_where_no_pixel_resembles_another() {
        let layout = everything();
        let store = store(
            60,
            60,
            layout.clone(),
            |_, _| 8,
            |x, y, _, rng| {
                let mut sample = wall(&layout, x, y, [rng.random(); 3], rng);
                // A material for each pixel, none within tolerance of another.
                let material = [x, y, x + 61 * y].map(|v| v as f32);
                layout.write(&mut sample, Block::Albedo, &material);
                sample
            },
        );
        let (failure, success) = interpolation_failure(&store, &PrpfSettings::paper(), 17);
        assert_eq!(success, 0.0);
        assert_eq!(filter(&store, &PrpfSettings::paper(), 1).interpolation_success, Some(0.0));
        // Nodes are never interpolated, and so never fail.
        assert_eq!(failure.plane(0).iter().sum::<f32>(), (60 * 60 - 12 * 12) as f32);
    }

    #[test]
    fn nothing_crosses_the_horizon() {
        let layout = everything();
        let ground = |x, y, rng: &mut rand_pcg::Pcg32| {
            let light = rng.random::<f32>();
            wall(&layout, x, y, [light, 0.0, 0.0], rng)
        };
        let sky = |x: usize, y: usize, rng: &mut rand_pcg::Pcg32| {
            let mut sample = wall(&layout, x, y, [0.0, 0.0, 3.0], rng);
            layout.write(&mut sample, Block::Hit, &[0.0]);
            sample
        };
        let half_sky = store(
            40,
            40,
            layout.clone(),
            |_, _| 8,
            |x, y, _, rng| {
                if y < 20 { sky(x, y, rng) } else { ground(x, y, rng) }
            },
        );
        let filtered = filter(&half_sky, &PrpfSettings::paper(), 1);
        for y in 0..40 {
            let (red, blue) = (filtered.image.row(0, y), filtered.image.row(2, y));
            if y < 20 {
                assert!(red.iter().all(|&v| v == 0.0) && blue.iter().all(|&v| v == 3.0));
            } else {
                assert!(red.iter().all(|&v| (v - 0.5).abs() < 0.15) && blue.iter().all(|&v| v == 0.0));
            }
        }
    }

    #[test]
    fn a_spike_leaves_no_halo() {
        let layout = everything();
        let make = |spike: f32| {
            store(
                60,
                60,
                layout.clone(),
                |_, _| 8,
                |x, y, index, rng| {
                    let light = 0.5 + 0.2 * (rng.random::<f32>() - 0.5);
                    let light = if (x, y, index) == (30, 30, 3) { spike } else { light };
                    wall(&layout, x, y, [light; 3], rng)
                },
            )
        };
        let settings = PrpfSettings::paper();
        let [with, without] = [1e8, 0.5].map(|spike| filter(&make(spike), &settings, 1).image);
        let change = |i: usize| (with.data()[i] / without.data()[i] - 1.0).abs();
        let pixels = with.pixels();
        let worst = (0..pixels).filter(|&i| i != 30 * 60 + 30).map(change).fold(0.0, f32::max);
        assert!(worst < 0.05, "{worst}");
        assert!(change(30 * 60 + 30) < 0.05, "{}", change(30 * 60 + 30));
    }

    #[test]
    fn threads_do_not_matter() {
        let store = noisy_wall(50, 37, 1.0, |x, _| 2 + x as u32 % 9);
        let [one, two] = [1, 2].map(|threads| {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
            pool.install(|| filter(&store, &PrpfSettings::paper(), 7))
        });
        assert_eq!(one.image, two.image);
        assert_eq!(one.error, two.error);
        assert_eq!(one.interpolation_failure, two.interpolation_failure);
    }

    #[test]
    fn a_store_that_keeps_no_samples_is_filtered() {
        let layout = everything();
        let mut store = Store::new(30, 30, layout.clone(), 0, 1);
        let mut rng = rand_pcg::Pcg32::new(1, 1);
        for (x, y) in (0..30).flat_map(|y| (0..30).map(move |x| (x, y))) {
            store.push(x, y, &wall(&layout, x, y, [1.0; 3], &mut rng));
        }
        assert_finite(&filter(&store, &PrpfSettings::paper(), 1));
    }

    #[test]
    fn a_scene_without_random_dimensions_is_filtered() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Position1));
        let store = store(
            30,
            30,
            layout.clone(),
            |_, _| 4,
            |x, y, _, rng| wall(&layout, x, y, [rng.random(); 3], rng),
        );
        assert_finite(&filter(&store, &PrpfSettings::paper(), 1));
    }
}
