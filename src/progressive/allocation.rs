//! Allocates the samples of a batch to pixels, and predicts whether adaptive sampling is worth its time.
//!
//! Takes the maps of the latest interim pass or a given map, and the priority region; gives the samples of each pixel.

use super::checkpoint::{Checkpoint, InterimPass};
use super::filter_pass::Filtered;
use super::region_batch::RegionBatch;
use super::schedule::LEAST_IMAGE;
use super::settings::Settings;
use super::steps;
use crate::adaptive::{self, FilterMaps, Sampling};
use crate::stats::{Rectangle, Store};

/// Samples that the pixels outside a region get for each of the region's, as long as some of them have none: the whole image
/// is filtered, saved and sampled adaptively only once it has no gaps.
const OUTSIDE_REGION: f64 = 1.0 / 3.0;

/// Spreads `total` samples over the pixels of a checkpoint's store. Returns the samples of each pixel.
pub(super) fn allocate_batch(
    checkpoint: &Checkpoint,
    region: Option<Rectangle>,
    settings: &Settings,
    total: u64,
) -> Vec<u32> {
    let Checkpoint { store, interim, .. } = checkpoint;
    // Rejected samples count: a pixel that rejects all of them must not hold up the others.
    let taken = store.next_indices();
    let map = settings.followed_map(store.pixels());
    let priority = match (checkpoint.sampling(settings), interim) {
        (Sampling::Adaptive, Some(interim)) => Some(batch_priority(store, interim, settings)),
        _ => map.map(|map| map.below(settings.max_spp)),
    };
    let (floor, max_spp) = (settings.min_spp.min(settings.max_spp), settings.max_spp);
    let key = adaptive::batch_key(store, settings.seed);
    let spread = |priority: Option<&[f32]>, have: &[u32], width: usize, total: u64| match (priority, map) {
        (Some(values), Some(map)) => adaptive::follow(values, map.unit(), have, width, total, max_spp, key),
        (Some(priority), None) => adaptive::allocate_above(floor, priority, have, width, total, max_spp, key),
        (None, _) => adaptive::uniform(total, have, max_spp, key),
    };

    let Some(batch) =
        region.and_then(|region| RegionBatch::new(&region, &taken, store.width(), total, settings))
    else {
        return spread(priority.as_deref(), &taken, store.width(), total);
    };
    if taken.iter().all(|&n| n == 0) {
        // The region waits for a coarse image of the whole.
        let first = (LEAST_IMAGE * taken.len() as f64).ceil() as u64;
        let mut counts = vec![0; taken.len()];
        begin_pixels(&mut counts, &taken, store.width(), first.min(total), max_spp);
        return counts;
    }
    let mut counts = batch.allocate(&taken, priority.as_deref(), spread);
    let outside = ((OUTSIDE_REGION * batch.samples() as f64) as u64).min(total - batch.samples());
    begin_pixels(&mut counts, &taken, store.width(), outside, max_spp);
    counts
}

/// Gives `total` samples to pixels that have none and get none: pairs, in the order in which the steps of a batch reach pixels.
fn begin_pixels(counts: &mut [u32], taken: &[u32], width: usize, total: u64, max_spp: u32) {
    let each = max_spp.min(2);
    let is_empty = |&i: &usize| taken[i] == 0 && counts[i] == 0;
    let mut empty: Vec<usize> = (0..counts.len()).filter(is_empty).collect();
    // At least one, or the first batch of a tiny image would have no sample.
    let pixels = (total.div_ceil(u64::from(each.max(1))) as usize).min(empty.len());
    if pixels < empty.len() {
        let turn = |i: usize| steps::turn(i % width, i / width);
        empty.select_nth_unstable_by(pixels, |&a, &b| turn(b).total_cmp(&turn(a)).then(a.cmp(&b)));
    }
    empty[..pixels].iter().for_each(|&i| counts[i] = each);
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
    let maps = FilterMaps {
        image: &interim.image,
        variance: &interim.variance,
        residual: &interim.residual,
        interpolation_failure: interim.interpolation.as_ref().map(|found| &found.failure),
    };
    adaptive::priority(store, maps, &settings.priority)
}

#[cfg(test)]
mod tests;
