//! Estimates against true errors of images that are known.

use rand::RngExt;

use super::*;
use crate::filter::synthetic::{store, wall};
use crate::filter::{DENOISERS, Reliability, UNFILTERED};
use crate::stats::{Block, Layout};

const SIDE: usize = 96;

/// Light and dark stripes, lit with noise.
fn truth(x: usize) -> f32 {
    if (x / 12).is_multiple_of(2) { 0.2 } else { 0.8 }
}

fn noisy_stripes(count: impl Fn(usize, usize) -> u32 + Sync) -> Store {
    let layout = Layout::with_blocks(|block| block != Block::Lens);
    store(SIDE, SIDE, layout.clone(), count, |x, y, _, rng| {
        let light = 2.0 * truth(x) * rng.random::<f32>();
        wall(&layout, x, y, [light; 3], rng)
    })
}

fn relmse(image: &Planes) -> f64 {
    let error = |i: usize| {
        let truth = f64::from(truth(i % SIDE));
        let squared = |c: usize| (f64::from(image.plane(c)[i]) - truth).powi(2);
        (0..3).map(squared).sum::<f64>() / 3.0 / (truth * truth + RELMSE_EPSILON)
    };
    (0..SIDE * SIDE).map(error).sum::<f64>() / (SIDE * SIDE) as f64
}

#[test]
fn the_true_error_lies_within_the_interval_or_within_a_factor_of_six_of_self_filtered_images() {
    for denoiser in DENOISERS {
        // Equal counts, and counts as adaptive sampling leaves them, with odd ones
        let uneven = |x: usize, y: usize| 3 + (x * 7 + y * 3) as u32 % 12;
        for store in [noisy_stripes(|_, _| 8), noisy_stripes(uneven)] {
            let result = denoiser.filter(&store, 0);
            let halves = HalfImages::new(denoiser, &store, |half| denoiser.filter(half, 0));
            let estimate = ErrorEstimate::new(&result, &store, halves.as_ref()).expect("two halves");
            let (truth, [low, high]) = (relmse(&result.image), estimate.interval());
            if result.reliability == Reliability::SELF_FILTERED && halves.is_none() {
                // Stripes that no feature shows: the weights follow the noise that they are to remove.
                assert!(
                    (1.0 / 6.0..6.0).contains(&(estimate.value / truth)),
                    "{denoiser:?}: {truth}, {estimate:?}"
                );
            } else {
                assert!((low..high).contains(&truth), "{denoiser:?}: {truth}, {estimate:?}");
                assert!(high - low < 1.5 * estimate.value, "{denoiser:?}: {estimate:?}");
            }
            assert_eq!(estimate.samples, store.samples());
        }
    }
}

#[test]
fn the_error_of_means_is_their_variance() {
    let store = noisy_stripes(|_, _| 16);
    let estimate = ErrorEstimate::new(&UNFILTERED.filter(&store, 0), &store, None).unwrap();
    // A uniform number of mean m has variance m²/3.
    let level = |m: f64| m * m / 3.0 / 16.0 / (m * m + RELMSE_EPSILON);
    let expected = 0.5 * (level(0.2) + level(0.8));
    // The blur of the level, across stripes, is most of the difference.
    assert!((estimate.value / expected - 1.0).abs() < 0.15, "{estimate:?} {expected}");
}

#[test]
fn fireflies_do_not_hide_their_own_error() {
    // One of 400 samples is 200 times as bright as the others together, of an image of mean 1.
    let layout = Layout::with_blocks(|_| false);
    let fireflies = store(
        SIDE,
        SIDE,
        layout.clone(),
        |_, _| 4,
        |x, y, _, rng| {
            let light = if rng.random::<f32>() < 1.0 / 400.0 { 200.0 } else { 0.5 };
            wall(&layout, x, y, [light; 3], rng)
        },
    );
    let estimate = ErrorEstimate::new(&UNFILTERED.filter(&fireflies, 0), &fireflies, None).unwrap();
    let expected = 199.5 * 199.5 / 400.0 / 4.0 / (1.0 + RELMSE_EPSILON);
    // The level lies below the mean between fireflies, and above it beside them.
    assert!((0.5..4.0).contains(&(estimate.value / expected)), "{estimate:?} {expected}");
}

#[test]
fn tiles_tell_where_the_error_is() {
    // The left half has a sixteenth of the samples of the right.
    let store = noisy_stripes(|x, _| if x < SIDE / 2 { 4 } else { 64 });
    let estimate = ErrorEstimate::new(&UNFILTERED.filter(&store, 0), &store, None).unwrap();
    let tiles = &estimate.tiles;
    let mean = |columns: std::ops::Range<usize>| {
        let sum: f32 = columns.flat_map(|x| (0..6).map(move |y| tiles.at(0, x, y))).sum();
        f64::from(sum) / 18.0
    };
    let [left, right] = [mean(0..3), mean(3..6)];
    assert!((8.0..32.0).contains(&(left / right)), "{left} {right}");
    assert!((0.5 * (left + right) / estimate.value - 1.0).abs() < 1e-3);
    assert_eq!(estimate.to_pixels(SIDE, SIDE).at(0, 17, 40), tiles.at(0, 1, 2));
}

#[test]
fn without_two_halves_there_is_no_estimate() {
    let single = noisy_stripes(|_, _| 1);
    assert_eq!(ErrorEstimate::new(&UNFILTERED.filter(&single, 0), &single, None), None);
    let third = noisy_stripes(|x, _| if x % 3 == 0 { 8 } else { 1 });
    assert_eq!(ErrorEstimate::new(&UNFILTERED.filter(&third, 0), &third, None), None);
}

#[test]
fn an_image_without_noise_has_no_error() {
    let layout = Layout::with_blocks(|_| true);
    let store = store(20, 20, layout.clone(), |_, _| 4, |x, y, _, rng| wall(&layout, x, y, [0.5; 3], rng));
    // A network changes what it is given, if only by a little.
    for denoiser in DENOISERS.into_iter().filter(|denoiser| denoiser.name().method != "oidn") {
        let estimate = ErrorEstimate::new(&denoiser.filter(&store, 0), &store, None).unwrap();
        assert!(estimate.value < 1e-9 && estimate.interval()[1] < 1e-9, "{denoiser:?} {estimate:?}");
    }
}
