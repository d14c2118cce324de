//! Pixel-based random parameter filtering (Park, Moon, Kim and Yoon, *P-RPF: pixel-based random parameter
//! filtering for Monte Carlo rendering*), the published method. It works on the means and variances of pixels
//! where random parameter filtering (RPF) works on samples.
//!
//! Algorithm 1 of the paper, and the functions that perform its steps:
//!
//! ```text
//! compute mean μ and standard deviation σ of each pixel            FeatureGuide::new, Colours::new
//! for each pass t = 0 … 3, with window b = 55, 35, 17, 7           filter_observed
//!     for each pixel i
//!         P_i ← similar pixels of the window (section 4.1)         FeatureGuide::is_similar, cluster
//!         μ̂_i, σ̂_i ← mean and deviation over P_i (Eqs. 1, 3)       Neighbourhood::new
//!     for each node i of the sparse grid I_s (section 4.3)         Grid::nodes
//!         α_i, β_i ← mutual information of samples in P_i          WeightInputs::evaluate
//!             (section 4.2)                                        Variables::weigh, BitSlices
//!     for each other pixel i
//!         α_i, β_i ← joint bilateral mean of the 16 nodes          upsampling::weights
//!             around it, or directly if that fails
//!     for each pixel i
//!         c′_i ← joint bilateral mean over P_i (Eq. 4)             bilateral::filter, inverse_bandwidths
//! ```
//!
//! Where the paper is silent, the code does the following. Distances and mutual information use the original
//! statistics in all passes; only the averaged values change. Eq. 4 has the bandwidth of RPF (Sen and Darabi
//! 2012), see [`Bandwidth`]. Only similar pixels are averaged. Fireflies are clamped before the first pass.
//! Three sums are sampled: the statistics of a neighbourhood are those of 9×9 of its pixels, mutual information
//! is that of at most 2048 samples, and the two large windows of Eq. 4 contribute every second row. Where
//! interpolation fails, one pixel of a block of 2×2 is a node to the others.

mod bilateral;
pub(super) mod bit_slices;
mod dissimilar_samples;
mod feature_guide;
mod grid;
mod interpolation_counts;
pub(super) mod inverse_bandwidths;
mod mutual_information;
mod neighbourhood;
mod reservoirs;
pub(super) mod sample_vector;
mod settings;
#[cfg(test)]
mod tests;
mod upsampling;
pub(super) mod variables;
mod weight_inputs;

use super::common::colours::Colours;
use super::denoiser::{Cost, Denoiser, Reads, SampleVectors};
use super::denoiser_name::DenoiserName;
use super::result::{FilterResult, Interpolation};
use super::stages::{Observer, Stage};
use crate::image::Planes;
use crate::stats::{Block, Store};
pub use dissimilar_samples::dissimilar_fraction;
use feature_guide::FeatureGuide;
use interpolation_counts::InterpolationCounts;
pub use mutual_information::mutual_information;
use neighbourhood::Neighbourhood;
use reservoirs::Reservoirs;
pub use settings::{Bandwidth, PrpfSettings};
use variables::weight_names;
use weight_inputs::WeightInputs;

/// Sample vectors in the reservoir of a pixel, from which mutual information is estimated: enough for the
/// smallest window.
pub const RESERVOIR: usize = 8;

/// Size of the window for which passes of other denoisers compute [`interpolation`], in pixels: that of the
/// third pass.
pub const FAILURE_WINDOW: usize = 17;

/// P-RPF with one of its presets.
pub struct Prpf {
    preset: Option<&'static str>,
    summary: &'static str,
    cost: Cost,
    settings: fn() -> PrpfSettings,
}

/// The published method.
pub static PRPF: Prpf = Prpf {
    preset: None,
    summary: "Pixel-based random parameter filtering as published; three of its sums are sampled",
    cost: Cost { core_seconds: 1.6e-5, bytes: 1300, pass_time: 18.0, is_per_sample: false },
    settings: PrpfSettings::paper,
};

/// The preset for interim passes.
pub static INTERIM: Prpf = Prpf {
    preset: Some("interim"),
    summary: "The same with one window and fewer samples in its statistics: for passes between batches",
    cost: Cost { core_seconds: 3.2e-6, bytes: 1300, pass_time: 3.0, is_per_sample: false },
    settings: PrpfSettings::interim,
};

const METHOD: &str = "prpf";

impl Denoiser for Prpf {
    fn name(&self) -> DenoiserName {
        DenoiserName { method: METHOD, preset: self.preset }
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn reads(&self) -> Reads {
        let blocks = &[
            Block::Film,
            Block::Colour,
            Block::Position1,
            Block::Normal1,
            Block::Albedo,
            Block::Position2,
            Block::Normal2,
            Block::Lens,
            Block::Time,
            Block::Light1,
            Block::Bsdf1,
            Block::Radiance,
            Block::Hit,
        ];
        Reads { blocks, sample_vectors: SampleVectors::Reservoir(RESERVOIR) }
    }

    fn cost(&self) -> Cost {
        self.cost
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &INTERIM
    }

    fn filter(&self, store: &Store, seed: u64) -> FilterResult {
        FilterResult { made_by: self.name(), ..filter(store, &(self.settings)(), seed) }
    }
}

/// Filters a store. `seed` selects the samples of mutual information; the result does not depend on the
/// number of threads.
pub fn filter(store: &Store, settings: &PrpfSettings, seed: u64) -> FilterResult {
    filter_observed(store, settings, seed, &|_| ())
}

/// Does the same as [`filter`] and calls `observe` at the start of each stage.
pub fn filter_observed(store: &Store, settings: &PrpfSettings, seed: u64, observe: Observer) -> FilterResult {
    // Prepare the unfiltered statistics
    observe(Stage::Other);
    let colours = Colours::new(store, &settings.fireflies);
    observe(Stage::Neighbourhoods);
    let guide = FeatureGuide::new(store, colours.guide(), settings);
    let reservoirs = Reservoirs::new(store);
    let mut values = colours.values(settings.margin());
    let mut interpolation = InterpolationCounts::new(store.width(), store.height());

    // Filter once per window
    for (pass, &window) in settings.windows.iter().enumerate() {
        observe(Stage::Neighbourhoods);
        let neighbourhood = Neighbourhood::new(&guide, window, settings.statistics_side);
        let normalisation_scale = colours.normalisation_scale();
        let inputs = WeightInputs {
            store,
            reservoirs: &reservoirs,
            guide: &guide,
            neighbourhood: &neighbourhood,
            normalisation_scale,
            settings,
            pass,
            window,
            seed,
        };
        observe(Stage::Weights);
        let weights = upsampling::weights(&inputs);
        observe(Stage::Filtering);
        values = bilateral::filter(&values, &guide, &neighbourhood, &weights, window, settings);
        interpolation.add(&weights, settings);
    }

    // Restore the brightness and estimate the error
    observe(Stage::Other);
    let images = colours.finish(&values, &settings.fireflies, |i, j| guide.is_similar(i, j));
    let interpolation = settings.upsampling.then(|| interpolation.finish());
    let made_by = DenoiserName { method: METHOD, preset: None };
    FilterResult { interpolation, ..colours.assess(made_by, images) }
}

/// Returns the weights that [`filter`] uses: their names, and for each pass a plane for each of them.
pub fn feature_weights(store: &Store, settings: &PrpfSettings, seed: u64) -> (Vec<String>, Vec<Planes>) {
    let colours = Colours::new(store, &settings.fireflies);
    let guide = FeatureGuide::new(store, colours.guide(), settings);
    let reservoirs = &Reservoirs::new(store);
    let normalisation_scale = colours.normalisation_scale();
    let pass_weights = |(pass, &window): (usize, &usize)| {
        let neighbourhood = &Neighbourhood::new(&guide, window, settings.statistics_side);
        let guide = &guide;
        let inputs = WeightInputs {
            store,
            reservoirs,
            guide,
            neighbourhood,
            normalisation_scale,
            settings,
            pass,
            window,
            seed,
        };
        upsampling::weights(&inputs).to_planes()
    };
    let mut names = weight_names(store.layout());
    names.push("interpolation".to_owned());
    (names, settings.windows.iter().enumerate().map(pass_weights).collect())
}

/// Computes where interpolation of weights between grid nodes fails, for one window of `window` pixels. It
/// does not need mutual information, and therefore no reservoirs.
pub fn interpolation(store: &Store, settings: &PrpfSettings, window: usize) -> Interpolation {
    let settings = &PrpfSettings { windows: vec![window], ..settings.clone() };
    let colours = Colours::new(store, &settings.fireflies);
    let guide = FeatureGuide::new(store, colours.guide(), settings);
    let mut interpolation = InterpolationCounts::new(store.width(), store.height());
    let neighbourhood = Neighbourhood::new(&guide, window, settings.statistics_side);
    interpolation.add(&upsampling::interpolation_sums(&guide, &neighbourhood, window, settings), settings);
    interpolation.finish()
}
