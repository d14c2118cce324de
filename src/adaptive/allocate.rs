//! Sample counts of a batch from priorities: exact sums, a share for everyone, a ceiling.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

/// Share of an adaptive batch that is spread regardless of priority: no pixel is ever given up, and
/// the pixels it falls on are an unbiased choice for measuring error.
const UNIFORM_SHARE: f64 = 0.15;
/// A pixel gets at most this many times the batch's mean (and two samples more by chance).
pub const CEILING: f64 = 8.0;

/// The plan of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Allocation {
    /// Samples to add per pixel.
    pub counts: Vec<u32>,
    /// Pixels that were chosen regardless of priority.
    pub probes: Vec<bool>,
}

/// `total` samples over all pixels, as even as can be; pixels with `max_spp` are passed over. What does not go
/// into all goes to those with the fewest samples (`have`), and by chance (`key`) among as many: to the first rows
/// it would be a border in the image, and an estimate of the error there and nowhere else.
pub fn uniform(total: u64, have: &[u32], max_spp: u32, key: u64) -> Allocation {
    let pixels = have.len();
    let mut open: Vec<usize> = (0..pixels).filter(|&i| have[i] < max_spp).collect();
    if !total.is_multiple_of(open.len().max(1) as u64) {
        open.shuffle(&mut Pcg64Mcg::seed_from_u64(key));
    }
    // Least room first: what finds no room there is left for the others.
    open.sort_by_key(|&i| max_spp - have[i]);
    let mut counts = vec![0; pixels];
    let mut left = total;
    for (k, &i) in open.iter().enumerate() {
        // What is left over the pixels that are left: differs by at most one between pixels.
        let share = (left / (open.len() - k) as u64).min(u64::from(max_spp - have[i])) as u32;
        counts[i] = share;
        left -= u64::from(share);
    }
    let probes = counts.iter().map(|&n| n > 0).collect();
    Allocation { counts, probes }
}

/// `total` samples, so that with those that a pixel has (`have`) the counts approach proportionality
/// to `priority`. Counts are even, so that both halves of a pixel grow alike (one pixel may get the
/// odd sample of an odd total). `width` is the image's; `key` decides which pixels the uniform
/// share falls on.
pub fn allocate(
    priority: &[f32],
    have: &[u32],
    width: usize,
    total: u64,
    max_spp: u32,
    key: u64,
) -> Allocation {
    let pixels = priority.len();
    let sum: f64 = priority.iter().map(|&p| f64::from(p)).sum();
    if sum.is_nan() || sum <= 0.0 || !sum.is_finite() {
        return uniform(total, have, max_spp, key);
    }
    let pairs = total / 2;
    let room = |i: usize| f64::from(max_spp.saturating_sub(have[i]) / 2);

    // Some pairs go to pixels chosen by chance alone.
    let chance = (UNIFORM_SHARE * pairs as f64 / pixels as f64).min(1.0);
    let probes: Vec<bool> = (0..pixels).map(|i| room(i) >= 1.0 && draw(i, key) < chance).collect();
    let probed = probes.iter().filter(|&&probe| probe).count() as u64;
    let probed = probed.min(pairs);

    // The rest raises pixels to what their priority asks for.
    let unprobed = |i: usize| (room(i) - f64::from(u8::from(probes[i]))).max(0.0);
    let most = (CEILING * pairs as f64 / pixels as f64).max(1.0);
    let targets = targets(priority, have, (pairs - probed) as f64, |i| most.min(unprobed(i)));
    let mut counts = round(&targets, width, pairs - probed, unprobed);
    let mut left = probed;
    for (count, _) in counts.iter_mut().zip(&probes).filter(|(_, probe)| **probe) {
        if left == 0 {
            break;
        }
        *count += 1;
        left -= 1;
    }
    counts.iter_mut().for_each(|n| *n *= 2);

    // What found no room in pairs, and the odd sample.
    let placed: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    if placed < total {
        let mut rest = total - placed;
        let ceiling = (most as u32).saturating_mul(2);
        // Pairs below the ceiling, then wherever there is room for pairs, then single samples.
        for (step, ceiling) in [(2, ceiling), (2, u32::MAX), (1, u32::MAX)] {
            let room = |counts: &[u32], i: usize| {
                max_spp.saturating_sub(have[i] + counts[i]).min(ceiling.saturating_sub(counts[i]))
            };
            let mut order: Vec<usize> = (0..pixels).filter(|&i| room(&counts, i) > 0).collect();
            order.sort_by(|&a, &b| priority[b].total_cmp(&priority[a]).then(a.cmp(&b)));
            while rest >= step && !order.is_empty() {
                order.retain(|&i| u64::from(room(&counts, i)) >= step);
                for &i in order.iter().take(usize::try_from(rest / step).unwrap_or(usize::MAX)) {
                    counts[i] += step as u32;
                    rest -= step;
                }
            }
        }
    }
    Allocation { counts, probes }
}

/// As [`allocate`], once all pixels have `floor` samples: those that lack some, as after a resume with a higher one,
/// get them first.
pub fn allocate_above(
    floor: u32,
    priority: &[f32],
    have: &[u32],
    width: usize,
    total: u64,
    max_spp: u32,
    key: u64,
) -> Allocation {
    let lacking: u64 = have.iter().map(|&n| u64::from(floor.saturating_sub(n))).sum();
    if lacking == 0 {
        return allocate(priority, have, width, total, max_spp, key);
    }
    let first = uniform(lacking.min(total), have, floor, key).counts;
    let have: Vec<u32> = have.iter().zip(&first).map(|(have, n)| have + n).collect();
    let mut rest = allocate(priority, &have, width, total.saturating_sub(lacking), max_spp, key);
    rest.counts.iter_mut().zip(first).for_each(|(n, first)| *n += first);
    rest
}

/// Pairs per pixel, not yet whole: max(0, λ·priority − have/2) with λ such that they sum to `pairs`,
/// each at most its ceiling.
fn targets(priority: &[f32], have: &[u32], pairs: f64, ceiling: impl Fn(usize) -> f64) -> Vec<f64> {
    let want = |lambda: f64, i: usize| {
        (lambda * f64::from(priority[i]) - 0.5 * f64::from(have[i])).clamp(0.0, ceiling(i))
    };
    let sum = |lambda: f64| (0..priority.len()).map(|i| want(lambda, i)).sum::<f64>();
    // The sum grows with λ: bracket, then bisect.
    let mut high = 1.0;
    for _ in 0..128 {
        if sum(high) >= pairs {
            break;
        }
        high *= 2.0;
    }
    // Priorities may be of any size.
    for _ in 0..128 {
        if sum(0.5 * high) < pairs {
            break;
        }
        high *= 0.5;
    }
    let mut low = 0.0;
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if sum(middle) < pairs { low = middle } else { high = middle }
    }
    (0..priority.len()).map(|i| want(high, i)).collect()
}

/// Enough to fix λ to a part in 10⁹ of the bracket.
const BISECTIONS: usize = 30;

/// How far the sum of targets may be off what it should be by the bisection's tolerance alone.
const MOST_CORRECTION: f64 = 1.0 + 1e-6;

/// Rounds targets to whole numbers whose sum is `pairs`, or theirs if that is less, carrying the
/// rounding error along a serpentine path through the image.
fn round(targets: &[f64], width: usize, pairs: u64, room: impl Fn(usize) -> f64) -> Vec<u32> {
    let sum: f64 = targets.iter().sum();
    // Rounding errors of the sum are made good; what ceilings cut off is left over.
    let scale = if sum > 0.0 { (pairs as f64 / sum).min(MOST_CORRECTION) } else { 0.0 };
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

/// A number in [0, 1) for a pixel and a key.
fn draw(pixel: usize, key: u64) -> f64 {
    let mut z = (pixel as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ key.wrapping_add(1).wrapping_mul(0xd1b5_4a32_d192_ed03);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NO_CEILING: u32 = u32::MAX / 4;

    fn total(allocation: &Allocation) -> u64 {
        allocation.counts.iter().map(|&n| u64::from(n)).sum()
    }

    #[test]
    fn a_uniform_batch_differs_by_at_most_one() {
        let a = uniform(1003, &[0; 100], NO_CEILING, 1);
        assert_eq!(total(&a), 1003);
        assert!(a.counts.iter().all(|&n| n == 10 || n == 11));
    }

    #[test]
    fn totals_approach_proportionality_to_priority() {
        let priority: Vec<f32> = (0..1024).map(|i| if i % 32 < 16 { 1.0 } else { 3.0 }).collect();
        let a = allocate(&priority, &[8; 1024], 32, 1024 * 24, NO_CEILING, 1);
        let mean = |low: bool| {
            let picked = (0..1024).filter(|i| (i % 32 < 16) == low).map(|i| 8 + a.counts[i]);
            f64::from(picked.sum::<u32>()) / 512.0
        };
        // 85 % follow the priorities, 15 % go to all alike.
        let ratio = mean(false) / mean(true);
        assert!(ratio > 2.2 && ratio < 3.0, "{ratio}");
    }

    #[test]
    fn priorities_of_any_size_are_shares() {
        for size in [1e-30, 1e-12, 1.0, 1e12, 1e30] {
            let targets = targets(&[size, 3.0 * size], &[0, 0], 8.0, |_| 100.0);
            assert!(
                (targets[0] - 2.0).abs() < 1e-6 && (targets[1] - 6.0).abs() < 1e-6,
                "{size}: {targets:?}"
            );
        }
    }

    #[test]
    fn all_error_in_one_pixel_does_not_take_everything() {
        let mut priority = vec![0.0; 400];
        priority[210] = 1.0;
        let a = allocate(&priority, &[4; 400], 20, 1600, NO_CEILING, 0);
        assert_eq!(total(&a), 1600);
        // Eight times the mean of 4, and a pair more by chance.
        assert!((16..=34).contains(&a.counts[210]), "{}", a.counts[210]);
        assert!(a.counts.iter().filter(|&&n| n > 0).count() > 30, "the uniform share is kept");
    }

    #[test]
    fn no_error_anywhere_falls_back_to_uniform() {
        assert_eq!(
            allocate(&[0.0; 64], &[4; 64], 8, 640, NO_CEILING, 3),
            uniform(640, &[4; 64], NO_CEILING, 3)
        );
    }

    proptest! {
        #[test]
        fn budgets_are_spent_exactly_and_ceilings_hold(
            priority in prop::collection::vec(0.0f32..10.0, 64),
            have in prop::collection::vec(0u32..40, 64),
            spend in 0u64..4000,
            spare in 0u32..100,
        ) {
            let max_spp = 40 + spare;
            let room: u64 = have.iter().map(|&n| u64::from(max_spp - n)).sum();
            let spend = spend.min(room);
            let a = allocate(&priority, &have, 8, spend, max_spp, 0);
            prop_assert_eq!(total(&a), spend);
            prop_assert!(a.counts.iter().zip(&have).all(|(n, h)| n + h <= max_spp));
            // Single samples come only after the pairs, and where there is no priority at all.
            let room_for_pairs: u64 = have.iter().map(|&n| u64::from((max_spp - n) & !1)).sum();
            let odd = a.counts.iter().filter(|&&n| n % 2 == 1).count();
            prop_assert!(spend > room_for_pairs || priority.iter().all(|&p| p == 0.0) || odd <= 1);
        }
    }

    #[test]
    fn every_probe_gets_a_pair_and_without_priority_nothing_else_does() {
        let priority: Vec<f32> = (0..900).map(|i| if i % 30 < 15 { 1.0 } else { 0.0 }).collect();
        let a = allocate(&priority, &[0; 900], 30, 3600, NO_CEILING, 5);
        assert_eq!(total(&a), 3600);
        let probes = a.probes.iter().filter(|&&probe| probe).count();
        // 15 % of 1800 pairs over 900 pixels: a chance of 0.3, to four deviations.
        assert!((215..325).contains(&probes), "{probes}");
        for ((&count, &probe), &priority) in a.counts.iter().zip(&a.probes).zip(&priority) {
            assert!(count.is_multiple_of(2) && (!probe || count >= 2), "{count}");
            assert!(priority > 0.0 || count == 2 * u32::from(probe), "{count}");
        }
        let other = allocate(&priority, &[0; 900], 30, 3600, NO_CEILING, 6);
        assert_ne!(a.probes, other.probes);
    }

    #[test]
    fn targets_are_what_priority_asks_for_beyond_what_is_there() {
        // λ·(1 + 2 + 3) − (2 + 1 + 0) = 9 for λ = 2; the last has nothing to ask for.
        let found = targets(&[1.0, 2.0, 3.0, 0.0], &[4, 2, 0, 8], 9.0, |_| 100.0);
        for (found, expected) in found.iter().zip([0.0, 3.0, 6.0, 0.0]) {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
        // Ceilings leave it to others: λ·(1 + 2) − 3 + 4 = 13 for λ = 4.
        let found = targets(&[1.0, 2.0, 3.0], &[4, 2, 0], 13.0, |i| if i == 2 { 4.0 } else { 100.0 });
        for (found, expected) in found.iter().zip([2.0, 7.0, 4.0]) {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
        // Small priorities ask for as much as large ones.
        let found = targets(&[1e-20, 3e-20], &[0, 0], 8.0, |_| 100.0);
        assert!((found[0] - 2.0).abs() < 1e-6 && (found[1] - 6.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn rounding_errors_are_carried_along_a_serpentine_path_and_rooms_hold() {
        assert_eq!(round(&[0.5; 8], 4, 4, |_| 9.0), [1, 0, 1, 0, 0, 1, 0, 1]);
        assert_eq!(round(&[0.4, 0.4, 0.4, 2.8], 2, 4, |_| 9.0), [0, 1, 0, 3]);
        // What finds no room is carried on.
        assert_eq!(round(&[3.0, 1.0, 1.0], 3, 5, |i| if i == 0 { 1.0 } else { 9.0 }), [1, 3, 1]);
        // Targets that fall short of the pairs are not blown up, and none is no target at all.
        assert_eq!(round(&[1.0; 4], 2, 100, |_| 9.0), [1; 4]);
        assert_eq!(round(&[0.0; 4], 2, 100, |_| 9.0), [0; 4]);
    }

    #[test]
    fn draws_are_uniform_over_pixels_and_keys() {
        for keys in [false, true] {
            let mut bins = [0_u32; 64];
            for i in 0..64_000 {
                let v = if keys { draw(7, i) } else { draw(i as usize, 3) };
                bins[(v * 64.0) as usize] += 1;
            }
            // 63 degrees of freedom: 1 in 10⁵ exceed 120, and as few are below 25.
            let chi2: f64 = bins.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
            assert!((25.0..120.0).contains(&chi2), "{chi2}");
        }
    }

    #[test]
    fn full_pixels_get_nothing_and_what_is_left_goes_to_the_highest_priorities() {
        let mut have = [4; 100];
        have[..50].fill(10);
        let priority: Vec<f32> = (0..100).map(|i| 1.0 + i as f32).collect();
        let a = allocate(&priority, &have, 10, 303, 10, 1);
        // 50 pixels with room for 6 are all there is.
        assert_eq!(total(&a), 300);
        assert!(a.counts[..50].iter().all(|&n| n == 0) && a.counts[50..].iter().all(|&n| n == 6));
        let odd = allocate(&priority, &[4; 100], 10, 401, NO_CEILING, 1);
        assert_eq!(total(&odd), 401);
        assert_eq!((0..100).filter(|&i| odd.counts[i] % 2 == 1).collect::<Vec<_>>(), [99]);
        let unknown = allocate(&[f32::NAN; 4], &[0; 4], 2, 8, 9, 1);
        assert_eq!(unknown.counts, [2; 4]);
    }

    #[test]
    fn uniform_batches_pass_over_full_pixels_and_tell_which_got_some() {
        let a = uniform(10, &[8, 0, 7, 0], 8, 1);
        assert!(a.counts == [0, 5, 1, 4] || a.counts == [0, 4, 1, 5], "{:?}", a.counts);
        assert_eq!(a.probes, [false, true, true, true]);
        assert_eq!(uniform(100, &[8, 0], 8, 1).counts, [0, 8]);
    }

    #[test]
    fn a_rest_goes_to_the_emptiest_pixels_wherever_they_are() {
        let (width, height) = (40, 30);
        // A quarter of the pixels has one sample more than the others.
        let have: Vec<u32> = (0..width * height).map(|i| 1 + u32::from(i % 4 == 0)).collect();
        let rest = 300;
        let of = |key: u64| uniform(1200 + rest, &have, NO_CEILING, key);
        let a = of(1);
        assert_eq!(total(&a), 1500);
        assert!(have.iter().zip(&a.counts).all(|(&have, &n)| n == 1 || n == 2 && have == 1));
        // A third of 900 pixels: per band of six rows 60 of 180, with a deviation below 6.
        for band in a.counts.chunks(6 * width) {
            let more = band.iter().filter(|&&n| n == 2).count();
            assert!((30..=90).contains(&more), "{more}");
        }
        assert_ne!(of(2).counts, a.counts);
    }

    #[test]
    fn pixels_below_the_floor_come_first() {
        // Nothing draws samples to the first half, which lacks 5 and 4 in turn.
        let priority: Vec<f32> = (0..400).map(|i| if i < 200 { 0.0 } else { 1.0 }).collect();
        let have: Vec<u32> = (0..400).map(|i| if i < 200 { 4 + i % 2 } else { 30 }).collect();
        for (total, met) in [(900, true), (1900, true), (700, false)] {
            let a = allocate_above(9, &priority, &have, 20, total, NO_CEILING, 0);
            assert_eq!(a.counts.iter().map(|&n| u64::from(n)).sum::<u64>(), total);
            let after: Vec<u32> = have.iter().zip(&a.counts).map(|(have, n)| have + n).collect();
            assert_eq!(after.iter().all(|&n| n >= 9), met, "{total}");
            if total <= 900 {
                assert!(a.counts[200..].iter().all(|&n| n == 0) && !a.probes.contains(&true));
                assert!(after[..200].iter().all(|n| (7..=9).contains(n)), "as even as can be");
            }
        }
        let above = allocate_above(4, &priority, &have, 20, 1000, NO_CEILING, 0);
        assert_eq!(above, allocate(&priority, &have, 20, 1000, NO_CEILING, 0));
    }
}
