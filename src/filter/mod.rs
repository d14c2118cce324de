//! Turns a pixel-statistics store into an image and its error maps: the [`Denoiser`] interface and the denoisers.
//!
//! Each method has a folder; `common` holds the steps that several of them use. Nothing here depends on where
//! samples come from.

mod cancellable_pool;
mod common;
mod denoiser;
mod denoiser_name;
mod denoisers;
pub mod learned;
mod missing_data;
pub mod nlm;
mod none;
pub mod oidn;
pub mod prpf;
mod result;
pub mod rpf;
mod selection;
pub(crate) mod sparse_filtering;
pub mod stages;
#[cfg(test)]
pub(crate) mod synthetic;
mod whole_image;

pub use cancellable_pool::{CancellablePool, stop_if_cancelled};
pub use common::blur;
pub use common::fireflies::FireflySettings;
pub use denoiser::{Cost, Denoiser, LayerFilter, PartFilter, Reads, SampleVectors};
pub use denoiser_name::DenoiserName;
pub use denoisers::{
    DEFAULT, DEFAULTS_BY_COST, DENOISERS, UNFILTERED, draft_if_sparse, draft_of, draft_without_vectors, find,
    presets, weights_of,
};
pub use missing_data::MissingData;
pub use nlm::NlmSettings;
pub use none::{risk_of_means, unfiltered};
pub use prpf::{Bandwidth, PrpfSettings, mutual_information};
pub use result::{FilterResult, Interpolation, Reliability};
pub use rpf::RpfSettings;
pub use selection::{SelectionError, by_name, can_filter};
pub use whole_image::{AllPixels, PlaneRows, WholeImage};

use crate::image::Planes;
use crate::stats::{Part, Store};

/// Returns the variance of the mean of the unfiltered radiance, directly visible emission included: 3 planes;
/// 0 at pixels with fewer than two samples.
pub fn variance_of_mean(store: &Store) -> Planes {
    let mut variance = store.variances(Part::Whole, store.layout().radiance());
    let counts = store.counts(Part::Whole);
    for plane in variance.planes_mut() {
        plane.iter_mut().zip(&counts).for_each(|(v, &n)| *v /= n.max(1) as f32);
    }
    variance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Block, Layout};

    #[test]
    fn the_variance_of_the_mean_is_that_of_the_samples_over_their_number() {
        let layout = Layout::with_blocks(|_| false);
        let mut store = Store::new(3, 1, layout.clone(), 0, 0);
        // A pixel with a sample variance of 20/3, one with a single sample and one without any
        for (pixel, values) in [(0, [3.0, 5.0, 7.0, 9.0].as_slice()), (1, &[4.0_f32])] {
            for &value in values {
                let mut sample = vec![0.0; layout.len()];
                layout.write(&mut sample, Block::Colour, &[value, 2.0 * value, 0.5]);
                layout.write(&mut sample, Block::Radiance, &[value, 2.0 * value, 0.5]);
                store.push(pixel, 0, &sample);
            }
        }
        let variance = variance_of_mean(&store);
        for (plane, expected) in [20.0 / 12.0, 4.0 * 20.0 / 12.0, 0.0].into_iter().enumerate() {
            let found = variance.plane(plane);
            assert!((found[0] - expected).abs() < 1e-5, "{plane}: {found:?}");
            assert_eq!(found[1..], [0.0; 2]);
        }
    }
}
