//! Exact sums, ceilings and proportionality of allocations.

use super::*;
use proptest::prelude::*;

fn total(counts: &[u32]) -> u64 {
    counts.iter().map(|&n| u64::from(n)).sum()
}

#[test]
fn counts_of_a_uniform_batch_differ_by_at_most_one() {
    let a = uniform(1003, &[0; 100], NO_CEILING, 1);
    assert_eq!(total(&a), 1003);
    assert!(a.iter().all(|&n| n == 10 || n == 11));
}

#[test]
fn totals_approach_proportionality_to_priority() {
    let priority: Vec<f32> = (0..1024).map(|i| if i % 32 < 16 { 1.0 } else { 3.0 }).collect();
    let a = allocate(&priority, &[8; 1024], 32, 1024 * 24, NO_CEILING, 1);
    let mean = |low: bool| {
        let picked = (0..1024).filter(|i| (i % 32 < 16) == low).map(|i| 8 + a[i]);
        f64::from(picked.sum::<u32>()) / 512.0
    };
    // 85 % follow the priorities, 15 % are uniform.
    let ratio = mean(false) / mean(true);
    assert!(ratio > 2.2 && ratio < 3.0, "{ratio}");
}

#[test]
fn only_ratios_of_priorities_matter() {
    for size in [1e-30, 1e-12, 1.0, 1e12, 1e30] {
        let targets = targets(&[size, 3.0 * size], &[0, 0], 8.0, |_| 100.0);
        assert!((targets[0] - 2.0).abs() < 1e-6 && (targets[1] - 6.0).abs() < 1e-6, "{size}: {targets:?}");
    }
}

#[test]
fn targets_sum_to_what_is_wanted_or_to_all_room() {
    let priority: Vec<f32> =
        (0..500).map(|i| if i % 7 == 0 { 0.0 } else { (i % 41) as f32 * 1e-3 }).collect();
    let have: Vec<u32> = (0..500).map(|i| 2 * (i * 13 % 29)).collect();
    let ceiling = |i: usize| (i % 5) as f64;
    let room: f64 = (0..500).filter(|&i| priority[i] > 0.0).map(ceiling).sum();
    for pairs in [1.0, 77.0, 500.0, 0.999 * room, 2.0 * room] {
        let targets = targets(&priority, &have, pairs, ceiling);
        let sum: f64 = targets.iter().sum();
        assert!((sum / pairs.min(room) - 1.0).abs() < 1e-8, "{pairs}: {sum}");
        assert!(targets.iter().enumerate().all(|(i, &target)| (0.0..=ceiling(i)).contains(&target)));
    }
}

#[test]
fn targets_are_found_across_plateaus_of_the_sum() {
    // Their sum stays at 1 and at 10 until the second pixel begins
    let found = targets(&[1.0, 1.0, 0.0], &[0, 1000, 0], 2.0, |i| [1.0, 9.0, 9.0][i]);
    assert!((found[0] - 1.0).abs() < 1e-6 && (found[1] - 1.0).abs() < 1e-6 && found[2] == 0.0, "{found:?}");
    let found = targets(&[1.0, 1e-3], &[0, 1000], 5.0, |i| [10.0, 9.0][i]);
    assert!((found[0] - 5.0).abs() < 1e-6 && found[1] == 0.0, "{found:?}");
    assert_eq!(targets(&[1.0, 2.0], &[3, 0], 0.0, |_| 5.0), [0.0; 2]);
}

#[test]
fn one_pixel_with_all_error_does_not_get_all_samples() {
    let mut priority = vec![0.0; 400];
    priority[210] = 1.0;
    let a = allocate(&priority, &[4; 400], 20, 1600, NO_CEILING, 0);
    assert_eq!(total(&a), 1600);
    // Eight times the mean of 4, and a pair of the uniform fraction.
    assert!((16..=34).contains(&a[210]), "{}", a[210]);
    assert!(a.iter().filter(|&&n| n > 0).count() > 30, "the uniform fraction remains");
}

#[test]
fn no_error_anywhere_falls_back_to_uniform() {
    assert_eq!(allocate(&[0.0; 64], &[4; 64], 8, 640, NO_CEILING, 3), uniform(640, &[4; 64], NO_CEILING, 3));
}

#[test]
fn enormous_totals_are_placed_at_once() {
    let mut priority = vec![0.0; 64];
    priority[3] = 1.0;
    let a = allocate(&priority, &[4; 64], 8, 1 << 40, NO_CEILING, 0);
    assert!(a.iter().all(|&n| n == NO_CEILING - 4), "{a:?}");
}

/// Does the same as [`place_remaining`] in rounds of one step for each pixel.
fn place_round_by_round(
    counts: &mut [u32],
    mut remaining: u64,
    ceiling: u32,
    priority: &[f32],
    most: &[u32],
) {
    for (step, ceiling) in [(2, ceiling), (2, u32::MAX), (1, u32::MAX)] {
        let room = |counts: &[u32], i: usize| (most[i] - counts[i]).min(ceiling.saturating_sub(counts[i]));
        let mut order: Vec<usize> = (0..counts.len()).collect();
        order.sort_by(|&a, &b| priority[b].total_cmp(&priority[a]).then(a.cmp(&b)));
        while remaining >= step.into() && order.iter().any(|&i| room(counts, i) >= step) {
            for &i in &order {
                if room(counts, i) >= step && remaining >= step.into() {
                    counts[i] += step;
                    remaining -= u64::from(step);
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn rounds_at_once_place_what_single_rounds_do(
        priority in prop::collection::vec(0.0f32..10.0, 16),
        most in prop::collection::vec(0u32..50, 16),
        remaining in 0u64..900,
        ceiling in 0u32..30,
    ) {
        let (mut found, mut expected) = (vec![0; 16], vec![0; 16]);
        place_remaining(&mut found, remaining, ceiling, &priority, |counts, i| most[i] - counts[i]);
        place_round_by_round(&mut expected, remaining, ceiling, &priority, &most);
        prop_assert_eq!(found, expected);
    }

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
        prop_assert!(a.iter().zip(&have).all(|(n, h)| n + h <= max_spp));
        // Single samples come only after the pairs, and where there is no priority at all.
        let room_for_pairs: u64 = have.iter().map(|&n| u64::from((max_spp - n) & !1)).sum();
        let odd = a.iter().filter(|&&n| n % 2 == 1).count();
        prop_assert!(spend > room_for_pairs || priority.iter().all(|&p| p == 0.0) || odd <= 1);
    }
}

#[test]
fn without_priority_random_pixels_get_a_pair() {
    let priority: Vec<f32> = (0..900).map(|i| if i % 30 < 15 { 1.0 } else { 0.0 }).collect();
    let a = allocate(&priority, &[0; 900], 30, 3600, NO_CEILING, 5);
    assert_eq!(total(&a), 3600);
    assert!(a.iter().all(|n| n.is_multiple_of(2)));
    let lowest: Vec<u32> = (0..900).filter(|&i| priority[i] == 0.0).map(|i| a[i]).collect();
    assert!(lowest.iter().all(|&n| n <= 2));
    // 15 % of 1800 pairs over 900 pixels: a probability of 0.3 for each of 450, within four standard deviations.
    let selected = lowest.iter().filter(|&&n| n == 2).count();
    assert!((97..174).contains(&selected), "{selected}");
    let other = allocate(&priority, &[0; 900], 30, 3600, NO_CEILING, 6);
    assert_ne!(a, other);
}

#[test]
fn targets_complement_the_samples_that_pixels_have() {
    // λ·(1 + 2 + 3) − (2 + 1 + 0) = 9 for λ = 2; the last priority is 0.
    let found = targets(&[1.0, 2.0, 3.0, 0.0], &[4, 2, 0, 8], 9.0, |_| 100.0);
    for (found, expected) in found.iter().zip([0.0, 3.0, 6.0, 0.0]) {
        assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
    }
    // With a ceiling of 4 for the third: λ·(1 + 2) − 3 + 4 = 13 for λ = 4.
    let found = targets(&[1.0, 2.0, 3.0], &[4, 2, 0], 13.0, |i| if i == 2 { 4.0 } else { 100.0 });
    for (found, expected) in found.iter().zip([2.0, 7.0, 4.0]) {
        assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
    }
    // The scale of priorities does not matter.
    let found = targets(&[1e-20, 3e-20], &[0, 0], 8.0, |_| 100.0);
    assert!((found[0] - 2.0).abs() < 1e-6 && (found[1] - 6.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn rounding_errors_are_diffused_along_a_serpentine_path_within_limits() {
    assert_eq!(round(&[0.5; 8], 4, 4, |_| 9.0), [1, 0, 1, 0, 0, 1, 0, 1]);
    assert_eq!(round(&[0.4, 0.4, 0.4, 2.8], 2, 4, |_| 9.0), [0, 1, 0, 3]);
    // Pairs that exceed a limit go to the next pixels.
    assert_eq!(round(&[3.0, 1.0, 1.0], 3, 5, |i| if i == 0 { 1.0 } else { 9.0 }), [1, 3, 1]);
    // Targets with a smaller sum than the pairs are not scaled up.
    assert_eq!(round(&[1.0; 4], 2, 100, |_| 9.0), [1; 4]);
    assert_eq!(round(&[0.0; 4], 2, 100, |_| 9.0), [0; 4]);
}

#[test]
fn random_numbers_are_uniform_over_pixels_and_keys() {
    for keys in [false, true] {
        let mut bins = [0_u32; 64];
        for i in 0..64_000 {
            let v = if keys { uniform_number(7, i) } else { uniform_number(i as usize, 3) };
            bins[(v * 64.0) as usize] += 1;
        }
        // With 63 degrees of freedom 1 in 10⁵ exceeds 120, and as few are below 25.
        let chi2: f64 = bins.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
        assert!((25.0..120.0).contains(&chi2), "{chi2}");
    }
}

#[test]
fn full_pixels_get_nothing_and_the_remainder_goes_to_the_highest_priorities() {
    let mut have = [4; 100];
    have[..50].fill(10);
    let priority: Vec<f32> = (0..100).map(|i| 1.0 + i as f32).collect();
    let a = allocate(&priority, &have, 10, 303, 10, 1);
    // 50 pixels can take 6 samples each.
    assert_eq!(total(&a), 300);
    assert!(a[..50].iter().all(|&n| n == 0) && a[50..].iter().all(|&n| n == 6));
    let odd = allocate(&priority, &[4; 100], 10, 401, NO_CEILING, 1);
    assert_eq!(total(&odd), 401);
    assert_eq!((0..100).filter(|&i| odd[i] % 2 == 1).collect::<Vec<_>>(), [99]);
    let unknown = allocate(&[f32::NAN; 4], &[0; 4], 2, 8, 9, 1);
    assert_eq!(unknown, [2; 4]);
}

#[test]
fn uniform_batches_skip_full_pixels() {
    let a = uniform(10, &[8, 0, 7, 0], 8, 1);
    assert!(a == [0, 5, 1, 4] || a == [0, 4, 1, 5], "{:?}", a);
    assert_eq!(uniform(100, &[8, 0], 8, 1), [0, 8]);
}

#[test]
fn the_remainder_goes_to_random_pixels_with_the_fewest_samples() {
    let (width, height) = (40, 30);
    // A quarter of the pixels has one more sample than the others.
    let have: Vec<u32> = (0..width * height).map(|i| 1 + u32::from(i % 4 == 0)).collect();
    let rest = 300;
    let allocate = |key: u64| uniform(1200 + rest, &have, NO_CEILING, key);
    let a = allocate(1);
    assert_eq!(total(&a), 1500);
    assert!(have.iter().zip(&a).all(|(&have, &n)| n == 1 || n == 2 && have == 1));
    // A third of 900 pixels: 60 of 180 in a band of six rows, with a standard deviation below 6.
    for band in a.chunks(6 * width) {
        let more = band.iter().filter(|&&n| n == 2).count();
        assert!((30..=90).contains(&more), "{more}");
    }
    assert_ne!(allocate(2), a);
}

#[test]
fn pixels_below_the_floor_come_first() {
    // The first half has no priority and lacks 5 or 4 samples per pixel.
    let priority: Vec<f32> = (0..400).map(|i| if i < 200 { 0.0 } else { 1.0 }).collect();
    let have: Vec<u32> = (0..400).map(|i| if i < 200 { 4 + i % 2 } else { 30 }).collect();
    for (total, met) in [(900, true), (1900, true), (700, false)] {
        let a = allocate_above(9, &priority, &have, 20, total, NO_CEILING, 0);
        assert_eq!(a.iter().map(|&n| u64::from(n)).sum::<u64>(), total);
        let after: Vec<u32> = have.iter().zip(&a).map(|(have, n)| have + n).collect();
        assert_eq!(after.iter().all(|&n| n >= 9), met, "{total}");
        if total <= 900 {
            assert!(a[200..].iter().all(|&n| n == 0));
            assert!(after[..200].iter().all(|n| (7..=9).contains(n)), "as even as possible");
        }
    }
    let above = allocate_above(4, &priority, &have, 20, 1000, NO_CEILING, 0);
    assert_eq!(above, allocate(&priority, &have, 20, 1000, NO_CEILING, 0));
}
