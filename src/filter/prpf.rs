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
    /// nearly that; against them 2048 change the error of the image by 1 to 20 %, 512 double it on some scenes.
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
mod tests;
