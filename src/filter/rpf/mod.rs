//! Random parameter filtering (Sen and Darabi, *On filtering the noise from the random parameters in
//! Monte Carlo rendering*, ACM TOG 31(3), 2012, and its technical report EECE-TR-11-0004): the method
//! from which P-RPF was derived, as a reference.
//!
//! It works on samples where P-RPF works on pixels. The steps, and the files that perform them:
//!
//! ```text
//! for each pass t with window b                                       settings
//!     for each pixel P with n samples
//!         candidates ← samples from a Gaussian around P with
//!             standard deviation b/4                                  candidate_sampler
//!         N ← P's samples and the similar candidates                  neighbourhood
//!         standardise N; α, β, W_c^r ← mutual information over N      weights
//!         for each sample i of P
//!             c″_i ← Σ w_ij c′_j ∕ Σ w_ij over j in N                 kernel
//!         clamp fireflies among the c″_i to their mean                fireflies
//!     c′ ← c″
//! pixel ← mean of its samples' c′                                     samples
//! ```
//!
//! Where the report is silent, the code does the following. Distances and mutual information use the
//! unfiltered samples in all passes; only c′ changes. The absolute similarity threshold of world positions is
//! that of P-RPF: the report's 0.1 is in units of the scene. With too few samples to estimate dependence,
//! weights are P-RPF's default. If sample counts differ, the bandwidth depends on that of P and the size of N
//! on the mean of the image. Standard deviations of a pixel's samples are unbiased. Samples far above or
//! below the mean are fireflies and replaced in all channels; what that takes from a pixel is given back to all its
//! samples ([`RpfSettings::energy_kept`]). Nothing is clamped before the first pass, so
//! that one sample of rare light shows as a spot of the window's size, as in the published method.

mod candidate_sampler;
mod fireflies;
mod kernel;
mod neighbourhood;
mod samples;
mod settings;
#[cfg(test)]
mod tests;
mod weights;

use rayon::prelude::*;

use super::cancellable_pool::stop_if_cancelled;
use super::common::colours::Colours;
use super::common::fireflies::FireflySettings;
use super::denoiser::{Cost, Denoiser, Reads, SampleVectors};
use super::denoiser_name::DenoiserName;
use super::nlm;
use super::prpf::variables::weight_names;
use super::result::FilterResult;
use super::stages::{Observer, Stage};
use crate::image::Planes;
use crate::stats::{Block, Store};
use candidate_sampler::CandidateSampler;
use kernel::Kernel;
use neighbourhood::{Clustering, Neighbourhood};
use samples::{Samples, Value};
pub use settings::{RpfFireflySettings, RpfPass, RpfSettings};
use weights::Weights;

/// Bytes beside the store for each sample: its colour, before a pass and after it.
const BYTES_PER_SAMPLE: usize = 2 * size_of::<Value>();

/// RPF of the technical report, except that the step against fireflies keeps the energy.
pub struct Rpf;

/// See [`Rpf`].
pub static RPF: Rpf = Rpf;

const NAME: DenoiserName = DenoiserName { method: "rpf", preset: None };

impl Denoiser for Rpf {
    fn name(&self) -> DenoiserName {
        NAME
    }

    fn summary(&self) -> &'static str {
        "Random parameter filtering, the slow predecessor of P-RPF: for comparison"
    }

    fn reads(&self) -> Reads {
        let blocks = &[Block::Colour, Block::Radiance];
        Reads { blocks, sample_vectors: SampleVectors::All { bytes_beside: BYTES_PER_SAMPLE } }
    }

    /// A fifth more seconds than measured: a cost that grows with the samples is not measured again during a
    /// render.
    fn cost(&self) -> Cost {
        Cost { core_seconds: 3.3e-4, bytes: 700, pass_time: 140.0, is_per_sample: true }
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &nlm::DRAFT
    }

    fn filter(&self, store: &Store, seed: u64) -> FilterResult {
        filter(store, &RpfSettings::energy_kept(), seed)
    }
}

/// Filters a store from the samples in its reservoirs, which should be all samples. `seed` selects
/// candidates; the result does not depend on the number of threads.
pub fn filter(store: &Store, settings: &RpfSettings, seed: u64) -> FilterResult {
    filter_observed(store, settings, seed, &|_| ())
}

/// Does the same as [`filter`] and calls `observe` at the start of each stage of each pixel.
pub fn filter_observed(store: &Store, settings: &RpfSettings, seed: u64, observe: Observer) -> FilterResult {
    let samples = Samples::from_store(store);
    let mut values = samples.values();
    for (t, pass) in settings.passes.iter().enumerate() {
        values = filter_once(store, &samples, &values, settings, (t, pass), seed, observe);
    }
    let none = FireflySettings::off();
    let colours = Colours::new(store, &none);
    let images =
        colours.finish(&samples.pixel_means(&values, colours.normalisation_scale()), &none, |_, _| true);
    colours.assess(NAME, images)
}

/// One pass over all pixels.
fn filter_once(
    store: &Store,
    samples: &Samples,
    values: &[Value],
    settings: &RpfSettings,
    (t, pass): (usize, &RpfPass),
    seed: u64,
    observe: Observer,
) -> Vec<Value> {
    let sampler = CandidateSampler::new(pass, settings, samples);
    let clustering = Clustering::new(settings, store.layout());
    let mut filtered = values.to_vec();
    let rows = samples.split_rows(&mut filtered).into_par_iter().enumerate();
    rows.for_each_init(
        || (Neighbourhood::new(&sampler, samples), Weights::new(store.layout()), Kernel::default()),
        |(neighbourhood, weights, kernel), (y, mut row)| {
            for x in 0..samples.width() {
                let own;
                (own, row) = row.split_at_mut(samples.count(x, y));
                if own.is_empty() {
                    continue;
                }
                stop_if_cancelled();
                observe(Stage::Neighbourhoods);
                neighbourhood.gather(samples, &sampler, &clustering, (x, y), (seed, t));
                observe(Stage::Weights);
                let scale = weights.evaluate(neighbourhood, settings, t, own.len());
                observe(Stage::Filtering);
                kernel.filter(neighbourhood, values, scale, own);
                fireflies::clamp(own, &settings.fireflies);
            }
            observe(Stage::Other);
        },
    );
    filtered
}

/// Returns the weights that [`filter`] uses: their names, and for each pass a plane for each of them; 0 at
/// pixels without samples.
pub fn feature_weights(store: &Store, settings: &RpfSettings, seed: u64) -> (Vec<String>, Vec<Planes>) {
    let samples = Samples::from_store(store);
    let names = weight_names(store.layout());
    let pass_weights = |(t, pass): (usize, &RpfPass)| {
        let sampler = CandidateSampler::new(pass, settings, &samples);
        let clustering = Clustering::new(settings, store.layout());
        let row = |y: usize| {
            let mut neighbourhood = Neighbourhood::new(&sampler, &samples);
            let mut weights = Weights::new(store.layout());
            let mut row = vec![0.0; samples.width() * names.len()];
            for (x, out) in row.chunks_exact_mut(names.len()).enumerate() {
                let own = samples.count(x, y);
                if own > 0 {
                    neighbourhood.gather(&samples, &sampler, &clustering, (x, y), (seed, t));
                    weights.evaluate(&neighbourhood, settings, t, own);
                    out.copy_from_slice(weights.latest());
                }
            }
            row
        };
        let rows: Vec<Vec<f32>> = (0..samples.height()).into_par_iter().map(row).collect();
        let mut planes = Planes::new(samples.width(), samples.height(), names.len());
        for (k, plane) in planes.planes_mut().enumerate() {
            let values = rows.iter().flat_map(|row| row.iter().skip(k).step_by(names.len()));
            plane.iter_mut().zip(values).for_each(|(out, &value)| *out = value);
        }
        planes
    };
    let passes = settings.passes.iter().enumerate().map(pass_weights).collect();
    (names, passes)
}
