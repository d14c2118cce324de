//! Computes the sample counts of a batch from priorities.
//!
//! Takes priorities and sample counts of all pixels and the number of samples of the batch. The counts add up to it, or to the room
//! that the ceiling per pixel leaves if that is less. A fraction of the batch is distributed uniformly.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

use crate::hash;

/// Fraction of an adaptive batch that is distributed regardless of priority, so that every pixel goes on to
/// be sampled.
const UNIFORM_FRACTION: f64 = 0.15;
/// Maximum number of samples of a pixel in units of the batch's mean, apart from two samples of the uniform
/// fraction.
pub const MAX_RATIO_TO_MEAN: f64 = 8.0;

/// No ceiling per pixel: more samples than any render takes.
pub const NO_CEILING: u32 = u32::MAX / 4;

/// Distributes `total` samples as evenly as possible over the pixels with fewer than `max_spp` samples. The
/// remainder of the division goes to the pixels with the fewest samples (`have`), and among equals to random
/// ones, selected by `key`: the first rows would show as a border in the image. Returns the samples of each pixel.
pub fn uniform(total: u64, have: &[u32], max_spp: u32, key: u64) -> Vec<u32> {
    let pixels = have.len();
    let mut open: Vec<usize> = (0..pixels).filter(|&i| have[i] < max_spp).collect();
    if !total.is_multiple_of(open.len().max(1) as u64) {
        open.shuffle(&mut Pcg64Mcg::seed_from_u64(key));
    }
    // Pixels closest to `max_spp` come first: what they cannot take remains for the others.
    open.sort_by_key(|&i| max_spp - have[i]);
    let mut counts = vec![0; pixels];
    let mut remaining = total;
    for (k, &i) in open.iter().enumerate() {
        // The remaining samples over the remaining pixels: counts differ by at most one
        let count = (remaining / (open.len() - k) as u64).min(u64::from(max_spp - have[i])) as u32;
        counts[i] = count;
        remaining -= u64::from(count);
    }
    counts
}

/// Distributes `total` samples so that the total counts, including the samples that pixels already have
/// (`have`), become proportional to `priority`. No pixel exceeds `max_spp`. Counts are even, so that both
/// halves of a pixel's samples grow equally; if `total` is odd, one pixel gets an odd count. `width` is that
/// of the image; `key` selects the pixels of the uniform fraction. Returns the samples of each pixel.
pub fn allocate(
    priority: &[f32],
    have: &[u32],
    width: usize,
    total: u64,
    max_spp: u32,
    key: u64,
) -> Vec<u32> {
    let pixels = priority.len();
    let sum: f64 = priority.iter().map(|&p| f64::from(p)).sum();
    if sum.is_nan() || sum <= 0.0 || !sum.is_finite() {
        return uniform(total, have, max_spp, key);
    }
    let pairs = total / 2;
    let room = |i: usize| f64::from(max_spp.saturating_sub(have[i]) / 2);

    // Select random pixels for the uniform fraction
    let chance = (UNIFORM_FRACTION * pairs as f64 / pixels as f64).min(1.0);
    let is_selected: Vec<bool> =
        (0..pixels).map(|i| room(i) >= 1.0 && uniform_number(i, key) < chance).collect();
    let selected = is_selected.iter().filter(|&&is_selected| is_selected).count() as u64;
    let selected = selected.min(pairs);

    // Distribute the other pairs by priority
    let other_room = |i: usize| (room(i) - f64::from(u8::from(is_selected[i]))).max(0.0);
    let max_pairs = (MAX_RATIO_TO_MEAN * pairs as f64 / pixels as f64).max(1.0);
    let targets = targets(priority, have, (pairs - selected) as f64, |i| max_pairs.min(other_room(i)));
    let mut counts = round(&targets, width, pairs - selected, other_room);
    let mut remaining = selected;
    for (count, _) in counts.iter_mut().zip(&is_selected).filter(|(_, is_selected)| **is_selected) {
        if remaining == 0 {
            break;
        }
        *count += 1;
        remaining -= 1;
    }
    counts.iter_mut().for_each(|n| *n *= 2);

    // Place the pairs that exceeded a limit, and the odd sample
    let placed: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    let ceiling = (max_pairs as u32).saturating_mul(2);
    place_remaining(&mut counts, total.saturating_sub(placed), ceiling, priority, |counts, i| {
        max_spp.saturating_sub(have[i] + counts[i])
    });
    counts
}

/// Adds `remaining` samples to the counts, by descending priority: pairs below the ceiling, then pairs
/// wherever there is room for them, then single samples. `room` is the number of samples that a pixel can
/// take.
fn place_remaining(
    counts: &mut [u32],
    mut remaining: u64,
    ceiling: u32,
    priority: &[f32],
    room: impl Fn(&[u32], usize) -> u32,
) {
    for (step, ceiling) in [(2, ceiling), (2, u32::MAX), (1, u32::MAX)] {
        if remaining < step {
            continue;
        }
        let room = |counts: &[u32], i: usize| room(counts, i).min(ceiling.saturating_sub(counts[i]));
        let has_room = |counts: &[u32], i: usize| u64::from(room(counts, i)) >= step;
        let mut order: Vec<usize> = (0..counts.len()).filter(|&i| has_room(counts, i)).collect();
        let descending = |&a: &usize, &b: &usize| priority[b].total_cmp(&priority[a]).then(a.cmp(&b));
        let reached = (remaining / step) as usize;
        if reached < order.len() {
            // The others get nothing: they need no order
            order.select_nth_unstable_by(reached, descending);
            order.truncate(reached);
        }
        order.sort_unstable_by(descending);
        while remaining >= step {
            order.retain(|&i| has_room(counts, i));
            let Some(least) = order.iter().map(|&i| room(counts, i)).min() else { break };
            // As many rounds at once as every pixel has room for; the last round reaches the first pixels only
            let pixels = order.len() as u64;
            let rounds = (remaining / step / pixels).min(u64::from(least) / step).max(1);
            let reached = pixels.min(remaining / step);
            order[..reached as usize].iter().for_each(|&i| counts[i] += (rounds * step) as u32);
            remaining -= rounds * step * reached;
        }
    }
}

/// Does the same as [`allocate`], after raising all pixels to `floor` samples. Pixels may be below it after a
/// resume with a higher floor.
pub fn allocate_above(
    floor: u32,
    priority: &[f32],
    have: &[u32],
    width: usize,
    total: u64,
    max_spp: u32,
    key: u64,
) -> Vec<u32> {
    let lacking: u64 = have.iter().map(|&n| u64::from(floor.saturating_sub(n))).sum();
    if lacking == 0 {
        return allocate(priority, have, width, total, max_spp, key);
    }
    let raised = uniform(lacking.min(total), have, floor, key);
    let have: Vec<u32> = have.iter().zip(&raised).map(|(have, n)| have + n).collect();
    let mut counts = allocate(priority, &have, width, total.saturating_sub(lacking), max_spp, key);
    counts.iter_mut().zip(raised).for_each(|(n, raised)| *n += raised);
    counts
}

/// Returns fractional numbers of pairs: max(0, λ·priority − have/2), limited by the ceiling of each pixel,
/// with λ such that they sum to `pairs`.
fn targets(priority: &[f32], have: &[u32], pairs: f64, ceiling: impl Fn(usize) -> f64) -> Vec<f64> {
    let ceilings: Vec<f64> = (0..priority.len()).map(ceiling).collect();
    let target = |lambda: f64, i: usize| {
        (lambda * f64::from(priority[i]) - 0.5 * f64::from(have[i])).clamp(0.0, ceilings[i])
    };
    // Returns the sum of the targets, and its derivative by λ
    let sum = |lambda: f64| {
        (0..priority.len()).fold((0.0, 0.0), |(sum, slope), i| {
            let value = target(lambda, i);
            let grows = value > 0.0 && value < ceilings[i];
            (sum + value, slope + if grows { f64::from(priority[i]) } else { 0.0 })
        })
    };

    // Find λ by Newton's method within a bracket. The first guess is exact where no limit applies
    let open = priority.iter().zip(&ceilings).filter(|(priority, _)| **priority > 0.0);
    let pairs = pairs.min(open.map(|(_, &ceiling)| ceiling).sum());
    if pairs == 0.0 {
        return vec![0.0; priority.len()];
    }
    let taken: f64 = have.iter().map(|&n| 0.5 * f64::from(n)).sum();
    let mut lambda = (taken + pairs) / priority.iter().map(|&p| f64::from(p)).sum::<f64>();
    let (mut low, mut high) = (0.0, f64::INFINITY);
    for _ in 0..MOST_STEPS {
        let (found, slope) = sum(lambda);
        if found < pairs {
            low = lambda
        } else {
            high = lambda
        }
        if (found - pairs).abs() <= TOLERANCE * pairs {
            return (0..priority.len()).map(|i| target(lambda, i)).collect();
        }
        let newton = lambda + (pairs - found) / slope;
        let next = if newton > low && newton < high {
            newton
        } else if high.is_finite() {
            0.5 * (low + high)
        } else {
            2.0 * lambda
        };
        if next == low || next == high {
            // No number is left between them
            break;
        }
        lambda = next;
    }
    let end = if high.is_finite() { high } else { lambda };
    (0..priority.len()).map(|i| target(end, i)).collect()
}

/// Maximum number of steps towards λ.
const MOST_STEPS: usize = 128;

/// Relative error of the sum of targets.
const TOLERANCE: f64 = 1e-9;

/// Maximum correction of the sum of targets for that error.
const MAX_CORRECTION: f64 = 1.0 + 1e-6;

/// Rounds targets to integers, diffusing the rounding error along a serpentine path through the image. Their
/// sum is `pairs`, or the sum of the targets if that is smaller. `room` limits each of them.
pub(super) fn round(targets: &[f64], width: usize, pairs: u64, room: impl Fn(usize) -> f64) -> Vec<u32> {
    let sum: f64 = targets.iter().sum();
    // Correct the error of λ, but not what ceilings cut off
    let scale = if sum > 0.0 { (pairs as f64 / sum).min(MAX_CORRECTION) } else { 0.0 };
    let mut counts = vec![0; targets.len()];
    let (mut wanted, mut given) = (0.0, 0u64);
    for k in 0..targets.len() {
        let (y, x) = (k / width, k % width);
        let i = y * width + if y % 2 == 0 { x } else { width - 1 - x };
        wanted += targets[i] * scale;
        let whole = (wanted.round() - given as f64).clamp(0.0, room(i)).min((pairs - given) as f64);
        counts[i] = whole as u32;
        given += whole as u64;
    }
    counts
}

/// 2⁶⁴ ∕ φ, with φ⁴ = φ + 1 (Roberts 2018, R₃): its multiples spread keys evenly.
const KEY_GAMMA: u64 = 0xd1b5_4a32_d192_ed03;

/// Returns a pseudo-random number in [0, 1) for a pixel and a key.
fn uniform_number(pixel: usize, key: u64) -> f64 {
    let z = (pixel as u64 + 1).wrapping_mul(hash::GAMMA) ^ key.wrapping_add(1).wrapping_mul(KEY_GAMMA);
    (hash::finalise(z) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests;
