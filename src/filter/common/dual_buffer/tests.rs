//! Sample counts, dual buffers and their variances against their definitions.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::filter::common::blur;
use crate::filter::common::variance_correction::SIGMA;
use crate::filter::synthetic::{store, wall};
use crate::stats::Layout;

const WIDTH: usize = 9;
const HEIGHT: usize = 6;
const PIXELS: usize = WIDTH * HEIGHT;

fn counts(of: [Vec<u32>; 2]) -> HalfCounts {
    HalfCounts::new(WIDTH, of)
}

fn planes(value: impl FnMut(usize) -> f32) -> Planes {
    let mut planes = Planes::new(WIDTH, HEIGHT, 3);
    let values: Vec<f32> = (0..3 * PIXELS).map(value).collect();
    planes.data_mut().copy_from_slice(&values);
    planes
}

fn random(seed: u64) -> Planes {
    let mut rng = Pcg32::seed_from_u64(seed);
    planes(|_| rng.random())
}

/// Pixels of the 3×3 around one.
fn around(i: usize) -> impl Iterator<Item = usize> {
    let near = |a: usize, b: usize| a.abs_diff(b) <= 1;
    (0..PIXELS).filter(move |j| near(i % WIDTH, j % WIDTH) && near(i / WIDTH, j / WIDTH))
}

#[test]
fn the_mean_of_halves_is_weighted_by_counts() {
    let counts = counts([vec![3; PIXELS], vec![1; PIXELS]]);
    assert_eq!(counts.mean([&planes(|_| 1.0), &planes(|_| 5.0)]).at(2, 4, 4), 2.0);
    let none = self::counts([vec![0; PIXELS], vec![0; PIXELS]]);
    assert_eq!(none.mean([&planes(|_| 1.0), &planes(|_| 5.0)]).at(1, 4, 4), 3.0);
    assert!(!none.have_variances() && counts.have_variances());
    assert!(!self::counts([vec![1; PIXELS], vec![0; PIXELS]]).have_variances());
    assert!(self::counts([vec![1; PIXELS], vec![1; PIXELS]]).have_variances());
}

#[test]
fn missing_halves_and_holes_are_filled() {
    let mut of = [vec![2; PIXELS], vec![2; PIXELS]];
    (of[0][3], of[1][5]) = (0, 0);
    // The centre of a hole of 3×3 pixels has no neighbour with samples.
    let hole: Vec<usize> = around(3 * WIDTH + 4).collect();
    hole.iter().for_each(|&i| of.iter_mut().for_each(|counts| counts[i] = 0));
    let (a, b) = (random(1), random(2));
    let mut mean = [a.clone(), b.clone()];
    counts(of).fill_missing(&mut mean);
    for c in 0..3 {
        assert_eq!((mean[0].plane(c)[3], mean[1].plane(c)[3]), (b.plane(c)[3], b.plane(c)[3]));
        assert_eq!((mean[0].plane(c)[5], mean[1].plane(c)[5]), (a.plane(c)[5], a.plane(c)[5]));
        for (mean, half) in mean.iter().zip([&a, &b]) {
            let (mean, half) = (mean.plane(c), half.plane(c));
            let middle = 3 * WIDTH + 4;
            for &i in hole.iter().filter(|&&i| i != middle) {
                let from: Vec<f32> = around(i).filter(|j| !hole.contains(j)).map(|j| mean[j]).collect();
                let expected = from.iter().sum::<f32>() / from.len() as f32;
                assert!((mean[i] - expected).abs() < 1e-6, "{i}");
            }
            let rim = hole.iter().filter(|&&i| i != middle).map(|&i| mean[i]).sum::<f32>() / 8.0;
            assert!((mean[middle] - rim).abs() < 1e-6);
            assert_eq!(mean[..3], half[..3]);
        }
    }
}

#[test]
fn variances_are_pooled_or_estimated_from_differences_of_means() {
    let count = |i: usize| [0, 1, 2, 5][(i * 7 + i / 5) % 4];
    // The two left columns have no neighbour with two samples.
    let of: Vec<u32> = (0..PIXELS).map(|i| if i % WIDTH < 3 { 1 } else { count(i) }).collect();
    let (mean, own) = (random(3), random(4));
    let known = |c: usize, i: usize| if of[i] >= 2 { own.plane(c)[i] } else { 0.0 };
    let sampled = planes(|k| known(k / PIXELS, k % PIXELS));
    let mut pooled = sampled.clone();
    let count: Vec<f32> = of.iter().map(|&n| n as f32).collect();
    pool_planes(&mut pooled, &mean, &count);
    for (c, i) in (0..3).flat_map(|c| (0..PIXELS).map(move |i| (c, i))) {
        let from: Vec<usize> = around(i).filter(|&j| of[j] >= 2).collect();
        let beside = if i % WIDTH > 0 { i - 1 } else { i + 1 };
        let pool = if from.is_empty() {
            (mean.plane(c)[i] - mean.plane(c)[beside]).powi(2) / 2.0 * of[i] as f32
        } else {
            from.iter().map(|&j| own.plane(c)[j]).sum::<f32>() / from.len() as f32
        };
        let freedom = of[i].saturating_sub(1) as f32;
        let expected = (2.0 * pool + freedom * known(c, i)) / (2.0 + freedom);
        let found = pooled.plane(c)[i];
        assert!((found - expected).abs() < 1e-5, "{c} {i}: {found} for {expected}");
    }
}

#[test]
fn the_correction_is_the_ratio_of_blurred_variances_within_its_range() {
    let (a, b) = (random(5), random(6));
    let mut of = [vec![2; PIXELS], vec![2; PIXELS]];
    of[1][20] = 0;
    let counts = counts(of);
    for scale in [0.1, 1e-3, 1e3] {
        let variance =
            [planes(|k| scale * (1.0 + (k % 7) as f32)), planes(|k| scale * (2.0 + (k % 3) as f32))];
        let sum = |of: &dyn Fn(usize, usize) -> f32| {
            let of_pixel = |i: usize| if i == 20 { 0.0 } else { (0..3).map(|c| of(c, i)).sum() };
            let plane: Vec<f32> = (0..PIXELS).map(of_pixel).collect();
            blur::gaussian(WIDTH, HEIGHT, &plane, SIGMA)
        };
        let seen = sum(&|c, i| (a.plane(c)[i] - b.plane(c)[i]).powi(2));
        let expected = sum(&|c, i| variance[0].plane(c)[i] + variance[1].plane(c)[i]);
        let found = variance_correction(&[a.clone(), b.clone()], &variance, &counts);
        for (i, found) in found.into_iter().enumerate() {
            let ratio = (seen[i] / expected[i]).clamp(0.02, 2.0);
            assert!((found - ratio).abs() < 1e-4 * ratio, "{i}: {found} for {ratio}");
        }
    }
    let none = planes(|_| 0.0);
    assert!(variance_correction(&[a, b], &[none.clone(), none], &counts).iter().all(|&factor| factor == 1.0));
}

#[test]
fn variances_are_those_of_the_means_and_fireflies_have_scaled_ones() {
    // Render a noisy wall without and with a firefly
    let layout = Layout::with_blocks(|_| false);
    let make = |firefly: f32| {
        store(
            WIDTH,
            HEIGHT,
            layout.clone(),
            |_, _| 9,
            |x, y, index, rng| {
                let light = rng.random::<f32>() + if (x, y, index) == (4, 3, 2) { firefly } else { 0.0 };
                wall(&layout, x, y, [light; 3], rng)
            },
        )
    };
    let (plain, with_firefly) = (make(0.0), make(1e4));
    let settings = FireflySettings::default();

    // Compare with s²∕n of the pooled variance, corrected
    let of = |store: &Store| {
        let counts = HalfCounts::from_store(store);
        (DualBuffer::from_store(store, layout.colour(), &counts), counts)
    };
    let (halves, counts) = of(&plain);
    let (mean, mut variance) = plain.halves(layout.colour());
    pool_planes(&mut variance, &mean[0], &[9.0; PIXELS]);
    let n = [5.0, 4.0];
    let of_mean = n.map(|n| planes(|k| variance.data()[k] / n));
    let correction = variance_correction(&mean, &of_mean, &counts);
    for (found, of_mean) in halves.variance.iter().zip(&of_mean) {
        for (k, (&found, &of_mean)) in found.data().iter().zip(of_mean.data()).enumerate() {
            let expected = of_mean * correction[k % PIXELS];
            assert!((found / expected - 1.0).abs() < 1e-5, "{k}: {found} for {expected}");
        }
    }

    // Clamp the firefly
    let (clean, clamped) = DualBuffer::from_store_clamped(
        &with_firefly,
        layout.colour(),
        &HalfCounts::from_store(&with_firefly),
        &settings,
    );
    assert_eq!(clamped.fireflies.len(), 1);
    let at = 3 * WIDTH + 4;
    // Unscaled, the variance would be 10⁷ times the usual one.
    let [left, usual] = [&clean, &halves].map(|halves| halves.variance[0].plane(0)[at]);
    assert!(left < 1000.0 * usual && left > 0.1 * usual, "{left} for {usual}");
    assert_eq!(clean.mean[0], clamped.halves[0]);
}

#[test]
fn constants_have_no_variance_and_single_samples_that_of_their_neighbours() {
    let layout = Layout::with_blocks(|_| false);
    for (n, noisy) in [(1, true), (2, false)] {
        let store = store(
            WIDTH,
            HEIGHT,
            layout.clone(),
            |_, _| n,
            |x, y, _, rng| wall(&layout, x, y, [x as f32; 3], rng),
        );
        let halves = DualBuffer::from_store(&store, layout.colour(), &HalfCounts::from_store(&store));
        assert!(halves.variance.iter().all(|half| half.data().iter().all(|&v| (v > 0.0) == noisy)));
    }
}

#[test]
fn division_divides_variances_by_the_square() {
    let mut halves =
        DualBuffer { mean: [random(1), random(2)], variance: [planes(|_| 0.9), planes(|_| 0.9)] };
    let first = halves.mean[1].at(2, 3, 3);
    halves.divide([&planes(|_| 1.0), &planes(|_| 3.0)]);
    assert_eq!(halves.variance[0].at(0, 1, 1), 0.9);
    assert!((halves.variance[1].at(2, 3, 3) - 0.1).abs() < 1e-6);
    assert!((halves.mean[1].at(2, 3, 3) - first / 3.0).abs() < 1e-6);
}

#[test]
fn a_single_column_of_single_samples_has_no_variance() {
    let layout = Layout::with_blocks(|_| false);
    let store = store(1, 5, layout.clone(), |_, _| 1, |x, y, _, rng| wall(&layout, x, y, [y as f32; 3], rng));
    let halves = DualBuffer::from_store(&store, layout.colour(), &HalfCounts::from_store(&store));
    assert!(halves.variance.iter().all(|half| half.data().iter().all(|&v| v == 0.0)));
}
