//! Tests of the store on hard inputs.

use super::*;
use crate::stats::{Block, LARGEST_VALUE, PIXEL_BLOCK, RowError};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};

const WIDTH: usize = 5;
const HEIGHT: usize = 3;

fn layout() -> Layout {
    Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Radiance | Block::Lens))
}

fn sample(layout: &Layout, value: impl FnMut(usize) -> f32) -> Vec<f32> {
    (0..layout.len()).map(value).collect()
}

fn random_store(seed: u64, per_pixel: u32) -> (Store, Vec<Vec<f32>>) {
    let layout = layout();
    let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
    let mut store = Store::new(WIDTH, HEIGHT, layout.clone(), 4, seed);
    let mut seen = vec![Vec::new(); WIDTH * HEIGHT];
    for (i, seen) in seen.iter_mut().enumerate() {
        for _ in 0..per_pixel {
            let s = sample(&layout, |_| rng.random());
            store.push(i % WIDTH, i / WIDTH, &s);
            seen.extend(s);
        }
    }
    (store, seen)
}

fn two_pass(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let m2: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, if values.len() < 2 { 0.0 } else { m2 / (values.len() - 1) as f64 })
}

#[test]
fn one_sample_has_its_value_and_no_variance() {
    let (store, seen) = random_store(1, 1);
    let m = store.rows()[0].moments(2, 4, Part::Whole);
    assert_eq!((m.count, m.mean as f32, m.variance()), (1, seen[2][4], 0.0));
}

#[test]
fn two_equal_samples_have_no_variance() {
    let layout = layout();
    let mut store = Store::new(1, 1, layout.clone(), 2, 0);
    let s = sample(&layout, |d| 0.1 + d as f32);
    store.push(0, 0, &[s.clone(), s].concat());
    assert!(store.variances(Part::Whole, 0..layout.len()).data().iter().all(|&v| v == 0.0));
}

#[test]
fn ten_million_samples_agree_with_an_exact_two_pass_sum() {
    let layout = Layout::with_blocks(|_| false);
    let mut store = Store::new(1, 1, layout.clone(), 0, 0);
    let mut rng = rand_pcg::Pcg64::seed_from_u64(3);
    let mut values = Vec::with_capacity(10_000_000);
    let mut block = Vec::new();
    for _ in 0..1000 {
        block.clear();
        for _ in 0..10_000 {
            let v = 0.5 + rng.random::<f32>();
            values.push(f64::from(v));
            block.extend([0.0, 0.0, v, v, v]);
        }
        store.push(0, 0, &block);
    }
    let (mean, variance) = two_pass(&values);
    let m = store.rows()[0].moments(0, 2, Part::Whole);
    assert_eq!(m.count, 10_000_000);
    assert!((m.mean / mean - 1.0).abs() < 1e-10, "{} {mean}", m.mean);
    // As certain as ten million samples make it: 1 ∕ √n of a uniform number's
    assert!((m.variance() / variance - 1.0).abs() < 3e-4, "{} {variance}", m.variance());
}

#[test]
fn a_deviation_of_some_steps_of_f32_is_seen_beside_a_large_mean() {
    let layout = Layout::with_blocks(|_| false);
    // `f32` values are 0.06 and 8 apart at these means.
    for (mean, deviation) in [(1e6, 1.0), (1e8, 40.0)] {
        let mut store = Store::new(1, 1, layout.clone(), 0, 0);
        let mut rng = rand_pcg::Pcg64::seed_from_u64(5);
        for _ in 0..100_000 {
            let v = mean + (12f32.sqrt() * deviation * (rng.random::<f32>() - 0.5));
            store.push(0, 0, &[0.0, 0.0, v, v, v]);
        }
        let sigma = store.rows()[0].moments(0, 2, Part::Whole).variance().sqrt() / f64::from(deviation);
        assert!((sigma - 1.0).abs() < 0.01, "{mean}: {sigma}");
    }
}

#[test]
fn bad_samples_are_counted_and_touch_no_statistic() {
    let layout = layout();
    let good = sample(&layout, |_| 0.5);
    let mut store = Store::new(1, 1, layout.clone(), 4, 0);
    store.push(0, 0, &good);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-3, 1.001 * LARGEST_VALUE] {
        for dim in layout.colour().chain(layout.radiance()) {
            let mut s = good.clone();
            s[dim] = bad;
            store.push(0, 0, &s);
        }
    }
    assert_eq!((store.samples(), store.rejected()), (1, 30));
    assert_eq!(store.rows()[0].next_index(0), 31, "a rejected sample uses up its index");
    assert!(store.means(Part::Whole, 0..layout.len()).data().iter().all(|&v| v == 0.5));
    assert_eq!(store.rows()[0].reservoir(0), good);
}

#[test]
fn negative_positions_are_no_reason_to_reject() {
    let layout = layout();
    let mut store = Store::new(1, 1, layout.clone(), 0, 0);
    store.push(
        0,
        0,
        &sample(&layout, |d| {
            if layout.colour().contains(&d) || layout.radiance().contains(&d) { 1.0 } else { -1.0 }
        }),
    );
    assert_eq!(store.rejected(), 0);
}

#[test]
fn merging_with_an_empty_store_changes_nothing() {
    let (store, _) = random_store(7, 9);
    let empty = Store::new(WIDTH, HEIGHT, layout(), 4, 8);
    let mut merged = store.clone();
    merged.merge(&empty);
    let all = 0..layout().len();
    for part in [Part::Whole, Part::Half(0), Part::Half(1)] {
        assert_eq!(merged.means(part, all.clone()), store.means(part, all.clone()));
        assert_eq!(merged.variances(part, all.clone()), store.variances(part, all.clone()));
        assert_eq!(merged.counts(part), store.counts(part));
    }
}

#[test]
fn a_cleared_store_is_an_empty_one_of_the_same_seed() {
    let (mut store, _) = random_store(3, 9);
    store.clear();
    assert_eq!(store.rows(), Store::new(WIDTH, HEIGHT, layout(), 4, 3).rows());
}

#[test]
fn reading_halves_at_once_equals_reading_them_one_by_one() {
    for per_pixel in [0, 1, 2, 7] {
        let (store, _) = random_store(11, per_pixel);
        let ([a, b], variance) = store.halves(2..5);
        assert_eq!(a, store.means(Part::Half(0), 2..5));
        assert_eq!(b, store.means(Part::Half(1), 2..5));
        let expected = store.variances(Part::Whole, 2..5);
        assert!(variance.data().iter().zip(expected.data()).all(|(v, e)| (v - e).abs() <= 1e-6 * e));
    }
}

#[test]
fn bytes_per_pixel_matches_the_memory_held() {
    let (width, layout) = (512, layout());
    let store = Store::new(width, 1, layout.clone(), 4, 0);
    let row = &store.rows()[0];
    let held =
        row.halves.iter().map(|h| h.count.len() * 4 + h.mean.len() * 8 + h.m2.len() * 4).sum::<usize>()
            + (row.next_index.len() + row.rejected.len()) * 4
            + row.keys.len() * 8
            + row.reservoir.len() * 4;
    let estimated = Store::bytes_per_pixel(&layout, 4) * width;
    // Rows are padded to an odd number of cache lines.
    assert!(held >= estimated && (held as f64) < 1.03 * estimated as f64, "{held} {estimated}");
}

#[test]
fn the_reservoir_keeps_a_uniform_choice() {
    let layout = Layout::with_blocks(|_| false);
    let (pixels, n, capacity) = (4000, 40, 4);
    let mut store = Store::new(pixels, 1, layout, capacity, 9);
    let mut kept = vec![0u32; n];
    for x in 0..pixels {
        for k in 0..n {
            store.push(x, 0, &[k as f32, 0.0, 0.0, 0.0, 0.0]);
        }
        store.rows()[0].reservoir(x).chunks(5).for_each(|s| kept[s[0] as usize] += 1);
    }
    let expected = (pixels * capacity) as f64 / n as f64;
    let chi2: f64 = kept.iter().map(|&k| (f64::from(k) - expected).powi(2) / expected).sum();
    // 39 degrees of freedom: 1 in 10⁴ exceed 81.
    assert!(chi2 < 81.0, "{chi2}");
}

proptest! {
    #[test]
    fn any_split_of_a_stream_merges_to_the_one_stream(
        values in prop::collection::vec(0.0f32..1e3, 2..60),
        cut in 0usize..60,
    ) {
        let layout = Layout::with_blocks(|_| false);
        // A sample's half follows from its index: an even cut keeps every sample in its half.
        let cut = cut.min(values.len()) & !1;
        let filled = |values: &[f32]| {
            let mut store = Store::new(1, 1, layout.clone(), 4, 0);
            values.iter().for_each(|&v| store.push(0, 0, &[v, v, v, v, v]));
            store
        };
        let whole = filled(&values);
        let (a, b) = (filled(&values[..cut]), filled(&values[cut..]));
        for (first, second) in [(&a, &b), (&b, &a)] {
            let mut merged = first.clone();
            merged.merge(second);
            for part in [Part::Whole, Part::Half(0), Part::Half(1)] {
                let (m, w) = (merged.rows()[0].moments(0, 2, part), whole.rows()[0].moments(0, 2, part));
                prop_assert_eq!(m.count, w.count);
                prop_assert!((m.mean - w.mean).abs() <= 1e-9 * w.mean.abs().max(1.0));
                prop_assert!((m.m2 - w.m2).abs() <= 1e-5 * w.m2.abs().max(1.0));
            }
        }
    }

    #[test]
    fn moments_equal_a_two_pass_recomputation(
        values in prop::collection::vec(0.0f32..1e6, 1..200),
        batch in 1usize..50,
    ) {
        let layout = Layout::with_blocks(|_| false);
        let mut store = Store::new(1, 1, layout, 0, 0);
        let vectors: Vec<f32> = values.iter().flat_map(|&v| [v; 5]).collect();
        vectors.chunks(5 * batch).for_each(|samples| store.push(0, 0, samples));
        let (mean, variance) = two_pass(&values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
        let m = store.rows()[0].moments(0, 3, Part::Whole);
        prop_assert!((m.mean - mean).abs() <= 1e-9 * mean.max(1.0));
        prop_assert!((m.variance() - variance).abs() <= 1e-6 * variance.max(1.0));
    }
}

#[test]
fn rows_round_trip_through_bytes_and_invalid_bytes_are_refused() {
    let (store, _) = random_store(13, 6);
    let layout = layout();
    let len = Row::byte_len(WIDTH, &layout, 4).expect("small");
    // Two counts, two halves with a count, a mean and a deviation each, and a reservoir.
    assert_eq!(len, WIDTH * (2 * 4 + 2 * (4 + 12 * layout.len()) + 4 * 4 * layout.len()));
    assert_eq!(Row::byte_len(usize::MAX / 8, &layout, 4), None);
    let empty = || Store::new(WIDTH, HEIGHT, layout.clone(), 4, 13);
    let mut bytes = vec![0; len];
    for (y, row) in store.rows().iter().enumerate() {
        row.to_bytes(&mut bytes);
        let mut read = empty();
        assert_eq!(read.rows_mut()[y].read_bytes(&bytes), Ok(()));
        assert_eq!(read.rows()[y], *row);
        assert_eq!((read.samples(), read.samples_taken()), (6 * WIDTH as u64, 6 * WIDTH as u64));
    }

    let read = |change: &dyn Fn(&mut [u8])| {
        let mut bytes = bytes.clone();
        change(&mut bytes);
        empty().rows_mut()[2].read_bytes(&bytes)
    };
    let values =
        |at: usize, value: f64| read(&|bytes| bytes[at..at + 8].copy_from_slice(&value.to_le_bytes()));
    assert_eq!(read(&|bytes| bytes[0] += 1), Err(RowError::Counts), "taken and not counted");
    assert_eq!(read(&|bytes| bytes[4 * WIDTH] += 1), Err(RowError::Counts), "rejected and not taken");
    let (means, planes) = (4 * 3 * WIDTH, 8 * layout.len() * WIDTH);
    for bad in [f64::NAN, f64::INFINITY, 1.6e15, -1.6e15] {
        assert_eq!(values(means, bad), Err(RowError::Values), "mean {bad}");
        assert_eq!(values(means + planes - 8, bad), Err(RowError::Values), "last mean {bad}");
    }
    assert_eq!(values(means, -1.4e15), Ok(()), "room for rounding");
    let radiance = layout.radiance().start;
    assert_eq!(values(means + 8 * radiance * WIDTH, -1e-9), Err(RowError::Values), "negative radiance");
    let kept = len - 4 * (layout.len() - radiance);
    let negative = read(&|bytes| bytes[kept..kept + 4].copy_from_slice(&(-1f32).to_le_bytes()));
    assert_eq!(negative, Err(RowError::Values), "negative radiance in the reservoir");
    // Three samples in each half: 3·(1.5·10¹⁵)².
    let deviation = |value: f32| {
        let at = means + planes;
        read(&|bytes| bytes[at..at + 4].copy_from_slice(&value.to_le_bytes()))
    };
    for bad in [f32::NAN, f32::INFINITY, -1e-9, 6.8e30] {
        assert_eq!(deviation(bad), Err(RowError::Values), "deviation {bad}");
    }
    assert_eq!(deviation(6.7e30), Ok(()));
    for bad in [f32::NAN, f32::INFINITY, 1.1e15] {
        let last = read(&|bytes| bytes[len - 4..].copy_from_slice(&bad.to_le_bytes()));
        assert_eq!(last, Err(RowError::Values), "sample {bad}");
    }
}

#[test]
fn rows_are_selected_and_reservoir_bytes_counted() {
    let (store, _) = random_store(17, 3);
    let some = store.select_rows([2, 0]);
    assert_eq!((some.width(), some.height(), some.pixels(), some.capacity()), (WIDTH, 2, 2 * WIDTH, 4));
    assert!(some.rows()[0] == store.rows()[2] && some.rows()[1] == store.rows()[0]);
    assert_eq!(store.reservoir_bytes(), (WIDTH * HEIGHT * 3 * 4 * layout().len()) as u64);
    assert_eq!(store.rows()[0].rejected(1), 0);
}

#[test]
fn a_merged_reservoir_samples_both_in_proportion_to_their_counts() {
    let layout = Layout::with_blocks(|_| false);
    let (pixels, capacity) = (4000, 4);
    let made = |n: u32, value: f32, seed: u64| {
        let mut store = Store::new(pixels, 1, layout.clone(), capacity, seed);
        (0..pixels).for_each(|x| (0..n).for_each(|_| store.push(x, 0, &[value; 5])));
        store
    };
    let mut merged = made(30, 1.0, 1);
    merged.merge(&made(10, 2.0, 2));
    let kept: Vec<f32> =
        (0..pixels).flat_map(|x| merged.rows()[0].reservoir(x).chunks(5).map(|s| s[0])).collect();
    assert_eq!(kept.len(), pixels * capacity);
    let fraction = kept.iter().filter(|&&v| v == 2.0).count() as f64 / kept.len() as f64;
    // A quarter, to five deviations of √(p(1 − p) ∕ n).
    assert!((fraction - 0.25).abs() < 5.0 * (0.1875 / 16_000.0_f64).sqrt(), "{fraction}");
    assert_eq!((merged.samples_taken(), merged.rows()[0].next_index(7)), (40 * pixels as u64, 40));
    let mut few = made(1, 1.0, 1);
    few.merge(&made(2, 2.0, 2));
    let mut all: Vec<f32> = few.rows()[0].reservoir(9).chunks(5).map(|s| s[0]).collect();
    all.sort_by(f32::total_cmp);
    assert_eq!(all, [1.0, 2.0, 2.0]);
}

#[test]
fn every_sample_of_merged_stores_is_kept_with_equal_probability() {
    let layout = Layout::with_blocks(|_| false);
    let (pixels, capacity) = (4000, 4);
    let made = |values: std::ops::Range<u32>, seed: u64| {
        let mut store = Store::new(pixels, 1, layout.clone(), capacity, seed);
        (0..pixels).for_each(|x| values.clone().for_each(|value| store.push(x, 0, &[value as f32; 5])));
        store
    };
    let mut merged = made(0..30, 1);
    merged.merge(&made(30..40, 2));
    merged.merge(&made(40..60, 2));
    let mut kept = [0_u32; 60];
    for x in 0..pixels {
        merged.rows()[0].reservoir(x).chunks(5).for_each(|sample| kept[sample[0] as usize] += 1);
    }
    let expected = (pixels * capacity) as f64 / 60.0;
    let chi2: f64 = kept.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
    // 59 degrees of freedom: 1 in 10⁵ exceed 117.
    assert!(chi2 < 117.0, "{chi2}");
}

#[test]
fn pushing_a_block_equals_pushing_its_pixels_one_by_one() {
    const WIDTH: usize = 37;
    let layout = layout();
    let mut rng = rand_pcg::Pcg64::seed_from_u64(8);
    let empty = || Store::new(WIDTH, 1, layout.clone(), 2, 1);
    let (mut by_block, mut one_by_one) = (empty(), empty());
    for step in 0..200 {
        let block = step % WIDTH.div_ceil(PIXEL_BLOCK);
        let pixels = PIXEL_BLOCK.min(WIDTH - block * PIXEL_BLOCK);
        let present = rng.random::<u32>() & ((1 << pixels) - 1);
        let mut values: Vec<[f32; PIXEL_BLOCK]> =
            (0..layout.len()).map(|_| std::array::from_fn(|_| 1.0 + rng.random::<f32>())).collect();
        // Some lanes are invalid, present or not.
        let dim = rng.random_range(0..layout.len());
        let hard = [f32::NAN, f32::NEG_INFINITY, -2.0, 2.0 * LARGEST_VALUE, 1.0];
        values[dim][rng.random_range(0..PIXEL_BLOCK)] = hard[step % hard.len()];
        by_block.rows_mut()[0].push_block(block, present, &values);
        for lane in (0..pixels).filter(|lane| present >> lane & 1 == 1) {
            let sample: Vec<f32> = values.iter().map(|lanes| lanes[lane]).collect();
            one_by_one.push(block * PIXEL_BLOCK + lane, 0, &sample);
        }
    }
    assert!(by_block.rejected() > 20 && by_block.samples() > 500);
    assert_eq!(by_block.rows(), one_by_one.rows());
}
