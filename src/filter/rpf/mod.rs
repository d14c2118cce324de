//! Random parameter filtering (Sen and Darabi, *On filtering the noise from the random parameters in
//! Monte Carlo rendering*, ACM TOG 31(3), 2012, and its technical report EECE-TR-11-0004): the method
//! that P-RPF follows, and is measured by.
//!
//! It works on samples where P-RPF works on pixels:
//!
//! ```text
//! for each pass, with its window b                                    settings
//!     for each pixel P with n samples
//!         N ← P's samples and draws of a Gaussian of deviation b/4
//!             around P, those left out that differ from P's own       neighbourhood
//!         standardise N; α, β, W_c^r ← mutual information over N      weights
//!         for each sample i of P
//!             c″_i ← Σ w_ij c′_j ∕ Σ w_ij over j in N                 kernel
//!         bring outliers among the c″_i to their mean                 spikes
//!     c′ ← c″
//! pixel ← mean of its samples' c′                                     samples
//! ```
//!
//! Distances and mutual information use the rendered samples in all passes, only c′ moves. What the
//! report leaves open is read as follows. A cluster's tolerance for world positions is that of
//! P-RPF here: the report's 0.1 is in units of the scene. Where samples are so few that they say nothing
//! on dependence, weights are P-RPF's default. Where sample counts differ, P's own counts in its
//! bandwidth and the mean of the image in the size of N. Deviations of a pixel's samples are unbiased.
//! Spikes are sought to both sides and replaced in all channels. Nothing is clamped beforehand, so that
//! one sample of rare light shows as a spot of the window's size, as it does in the published method.

mod kernel;
mod neighbourhood;
mod samples;
mod settings;
mod spikes;
#[cfg(test)]
mod tests;
mod weights;

use rayon::prelude::*;

use super::Filtered;
use super::colours::Colours;
use super::outliers::OutlierSettings;
use crate::stats::Store;
use kernel::Kernel;
use neighbourhood::{Draws, Neighbourhood};
use samples::{Samples, Value};
pub use settings::{RpfPass, RpfSettings, SpikeSettings};
use weights::Weights;

/// Bytes beside the store for each sample that is kept: its colour, before a pass and after it.
pub const BYTES_PER_SAMPLE: usize = 2 * size_of::<Value>();

/// Filters a store's image from the samples that it keeps whole, which should be all. Deterministic in
/// `seed`, whatever the number of threads.
pub fn filter(store: &Store, settings: &RpfSettings, seed: u64) -> Filtered {
    let samples = Samples::of(store);
    let mut values = samples.values();
    for (t, pass) in settings.passes.iter().enumerate() {
        values = filter_once(store, &samples, &values, settings, (t, pass), seed);
    }
    let none = OutlierSettings::off();
    let colours = Colours::new(store, &none);
    let images = colours.finish(&samples.pixels(&values, colours.exposure()), &none, |_, _| true);
    colours.assess(images)
}

/// One pass over all pixels.
fn filter_once(
    store: &Store,
    samples: &Samples,
    values: &[Value],
    settings: &RpfSettings,
    (t, pass): (usize, &RpfPass),
    seed: u64,
) -> Vec<Value> {
    let draws = Draws::new(pass, settings, samples, store.layout());
    let mut filtered = values.to_vec();
    let rows = samples.rows_of(&mut filtered).into_par_iter().enumerate();
    rows.for_each_init(
        || (Neighbourhood::new(&draws), Weights::new(store.layout(), &draws), Kernel::default()),
        |(neighbourhood, weights, kernel), (y, mut row)| {
            for x in 0..samples.width() {
                let own;
                (own, row) = row.split_at_mut(samples.count(x, y));
                if own.is_empty() {
                    continue;
                }
                neighbourhood.gather(samples, &draws, settings, (x, y), (seed, t));
                let scale = weights.evaluate(neighbourhood, settings, t, own.len());
                kernel.filter(neighbourhood, values, scale, own);
                spikes::remove(own, &settings.spikes);
            }
        },
    );
    filtered
}
