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
    let risk = risk_of_means(store, &halves);
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

/// Returns an unbiased estimate of the squared error of the mean radiance, far too noisy pixel by pixel, from the difference of
/// the means of its `halves`: 3 planes; 0 where a half has no samples.
pub fn risk_of_means(store: &Store, halves: &[Planes; 2]) -> Planes {
    let counts = [0, 1].map(|half| store.counts(Part::Half(half)));
    let mut risk = Planes::new(store.width(), store.height(), 3);
    for plane in 0..3 {
        let [a, b] = halves.each_ref().map(|half| half.plane(plane));
        for (i, risk) in risk.plane_mut(plane).iter_mut().enumerate() {
            let [n_a, n_b] = counts.each_ref().map(|counts| counts[i] as f32);
            if let Some([p_a, p_b]) = fractions(n_a, n_b) {
                *risk = p_a * p_b * (a[i] - b[i]).powi(2);
            }
        }
    }
    risk
}
