//! Allocates the samples of a batch to pixels, and predicts whether adaptive sampling is worth its time.
//!
//! Takes the maps of the latest interim pass or a given map, and the priority region; gives the samples of each pixel.

use super::checkpoint::{Checkpoint, InterimPass};
use super::filter_pass::Filtered;
use super::region::Region;
use super::settings::Settings;
use crate::adaptive::{self, Maps, Sampling};
use crate::filter;
use crate::stats::{Part, Store};

/// Spreads `total` samples over the pixels of a checkpoint's store. Returns the samples of each pixel.
pub(super) fn allocate_batch(
    checkpoint: &Checkpoint,
    region: Option<Region>,
    settings: &Settings,
    total: u64,
) -> Vec<u32> {
    let Checkpoint { store, interim, .. } = checkpoint;
    // Rejected samples count: a pixel that rejects all of them must not hold up the others.
    let taken = store.next_indices();
    let map = settings.followed_map(store.pixels());
    let priority = match (checkpoint.sampling(settings), interim) {
        (Sampling::Adaptive, Some(interim)) => Some(batch_priority(store, interim, settings)),
        _ => map.map(|map| map.values().to_vec()),
    };
    let (floor, max_spp) = (settings.min_spp.min(settings.max_spp), settings.max_spp);
    let key = adaptive::batch_key(store, settings.seed);
    let spread = |priority: Option<&[f32]>, have: &[u32], width: usize, total: u64| match (priority, map) {
        (Some(values), Some(map)) => adaptive::follow(values, map.unit(), have, width, total, max_spp, key),
        (Some(priority), None) => adaptive::allocate_above(floor, priority, have, width, total, max_spp, key),
        (None, _) => adaptive::uniform(total, have, max_spp, key),
    };

    // A region comes first only when every pixel has a sample.
    let is_covered = || taken.iter().all(|&n| n > 0);
    let batch = region
        .filter(|_| is_covered())
        .and_then(|region| region.batch(&taken, store.width(), total, settings));
    match batch {
        Some(batch) => batch.allocate(&taken, priority.as_deref(), spread),
        None => spread(priority.as_deref(), &taken, store.width(), total),
    }
}

/// Returns the samples that each pixel of a checkpoint's store gets of the next `total` samples, by the maps of a pass over all
/// samples so far.
pub fn allocate_after(
    checkpoint: Checkpoint,
    filtered: Filtered,
    settings: &Settings,
    total: u64,
) -> Vec<u32> {
    let checkpoint = Checkpoint { interim: Some(InterimPass::new(filtered)), ..checkpoint };
    allocate_batch(&checkpoint, None, settings, total)
}

/// Returns the [expected ratio](adaptive::expected_ratio) of the errors of adaptive and uniform sampling by the maps of
/// an interim pass.
pub(super) fn expected_ratio(store: &Store, interim: &InterimPass, settings: &Settings) -> f64 {
    adaptive::expected_ratio(&batch_priority(store, interim, settings))
}

/// Computes the priority of each pixel.
fn batch_priority(store: &Store, interim: &InterimPass, settings: &Settings) -> Vec<f32> {
    let maps = Maps {
        counts: &store.counts(Part::Whole),
        image: &interim.image,
        filtered_variance: &interim.variance,
        raw_variance: &filter::variance_of_mean(store),
        residual: &interim.residual,
        interpolation_failure: interim.interpolation.as_ref().map(|found| &found.failure),
    };
    adaptive::priority(maps, &settings.priority)
}

#[cfg(test)]
mod tests;
