//! No denoiser: the mean of the samples, with the variance and the error that follow from it.

use super::common::error_maps::fractions;
use super::common::hole_filling::filled_means;
use super::denoiser::{Cost, Denoiser, PartFilter, Reads, SampleVectors};
use super::denoiser_name::DenoiserName;
use super::result::{FilterResult, Reliability};
use super::variance_of_mean;
use super::whole_image::WholeImage;
use crate::image::Planes;
use crate::stats::{Block, Part, Store};

/// The mean of the samples.
pub struct NoDenoiser;

/// See [`NoDenoiser`].
pub static NONE: NoDenoiser = NoDenoiser;

const NAME: DenoiserName = DenoiserName { method: "none", preset: None };

impl Denoiser for NoDenoiser {
    fn name(&self) -> DenoiserName {
        NAME
    }

    fn summary(&self) -> &'static str {
        "The mean of the samples"
    }

    fn reads(&self) -> Reads {
        Reads { blocks: &[Block::Colour, Block::Radiance], sample_vectors: SampleVectors::None }
    }

    fn cost(&self) -> Cost {
        Cost { core_seconds: 0.7e-6, bytes: 300, pass_time: 0.3, is_per_sample: false }
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &NONE
    }

    fn filter(&self, store: &Store, _: u64) -> FilterResult {
        unfiltered(store)
    }

    fn parts(&self) -> Option<&dyn PartFilter> {
        Some(self)
    }
}

impl PartFilter for NoDenoiser {
    fn margin(&self) -> usize {
        0
    }

    fn filter_part(&self, store: &Store, _: &dyn WholeImage) -> FilterResult {
        unfiltered(store)
    }
}

/// Returns the means of the samples as a filter's result. Pixels without samples are filled from their
/// nearest neighbours with samples.
pub fn unfiltered(store: &Store) -> FilterResult {
    let radiance = store.layout().radiance();
    let variance = variance_of_mean(store);
    let mut error = Planes::new(store.width(), store.height(), 1);
    let mut residual = error.clone();
    residual.data_mut().fill(1.0);
    for (i, error) in error.data_mut().iter_mut().enumerate() {
        *error = variance.channel_mean(i);
    }
    let image = filled_means(store, radiance.clone());
    let halves = [0, 1].map(|h| store.means(Part::Half(h), radiance.clone()));
    let mut risk = Planes::new(store.width(), store.height(), 3);
    let counts = [0, 1].map(|h| store.counts(Part::Half(h)));
    for (i, risk) in risk.data_mut().iter_mut().enumerate() {
        let [n_a, n_b] = counts.each_ref().map(|n| n[i % store.pixels()] as f32);
        if let Some([p_a, p_b]) = fractions(n_a, n_b) {
            // The variance of the mean, from the difference of two independent ones
            *risk = p_a * p_b * (halves[0].data()[i] - halves[1].data()[i]).powi(2);
        }
    }
    let reliability = Reliability::UNFILTERED;
    FilterResult {
        made_by: NAME,
        image,
        halves,
        variance,
        error,
        residual,
        risk,
        reliability,
        interpolation: None,
        failure: None,
    }
}
