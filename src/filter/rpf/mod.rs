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
use super::stages::{Observer, Stage};
use super::weights::names as weight_names;
use crate::image::Planes;
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
    filter_observed(store, settings, seed, &|_| ())
}

/// The same, `observe` being told of each stage that begins, pixel for pixel and on the thread that does it.
pub fn filter_observed(store: &Store, settings: &RpfSettings, seed: u64, observe: Observer) -> Filtered {
    let samples = Samples::of(store);
    let mut values = samples.values();
    for (t, pass) in settings.passes.iter().enumerate() {
        values = filter_once(store, &samples, &values, settings, (t, pass), seed, observe);
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
    observe: Observer,
) -> Vec<Value> {
    let draws = Draws::new(pass, settings, samples, store.layout());
    let mut filtered = values.to_vec();
    let rows = samples.rows_of(&mut filtered).into_par_iter().enumerate();
    rows.for_each_init(
        || (Neighbourhood::new(&draws), Weights::new(store.layout()), Kernel::default()),
        |(neighbourhood, weights, kernel), (y, mut row)| {
            for x in 0..samples.width() {
                let own;
                (own, row) = row.split_at_mut(samples.count(x, y));
                if own.is_empty() {
                    continue;
                }
                observe(Stage::Neighbourhoods);
                neighbourhood.gather(samples, &draws, settings, (x, y), (seed, t));
                observe(Stage::Weights);
                let scale = weights.evaluate(neighbourhood, settings, t, own.len());
                observe(Stage::Filtering);
                kernel.filter(neighbourhood, values, scale, own);
                spikes::remove(own, &settings.spikes);
            }
            observe(Stage::Other);
        },
    );
    filtered
}

/// The weights that [`filter`] uses: their names, and for each pass a plane for each of them. Without samples
/// a pixel has none, and 0 stands.
pub fn feature_weights(store: &Store, settings: &RpfSettings, seed: u64) -> (Vec<String>, Vec<Planes>) {
    let samples = Samples::of(store);
    let names = weight_names(store.layout());
    let of_pass = |(t, pass): (usize, &RpfPass)| {
        let draws = Draws::new(pass, settings, &samples, store.layout());
        let row = |y: usize| {
            let (mut neighbourhood, mut weights) = (Neighbourhood::new(&draws), Weights::new(store.layout()));
            let mut row = vec![0.0; samples.width() * names.len()];
            for (x, out) in row.chunks_exact_mut(names.len()).enumerate() {
                let own = samples.count(x, y);
                if own > 0 {
                    neighbourhood.gather(&samples, &draws, settings, (x, y), (seed, t));
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
    let passes = settings.passes.iter().enumerate().map(of_pass).collect();
    (names, passes)
}
