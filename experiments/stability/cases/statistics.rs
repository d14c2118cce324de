//! Cases on statistics: moments, their merging, and sample counts that differ between pixels.

use prpf::stats::{Layout, Moments, Part, Store};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::case::Bound::{AtMost, Exactly};
use super::case::{Case, largest, relative};
use super::effort::Effort;

/// Relative error that rounding to `f32` leaves in sums of squared deviations of up to some ten thousand samples.
const ROUNDING: f64 = 1e-5;

/// Batches of 0 to 10⁴ samples that `cargo test` adds: some ten thousand samples.
const BATCHES_IN_TESTS: usize = 8;

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases =
        vec![one_sample(), two_equal_samples(), many_samples(effort.select(10_000_000, 100_000_000))];
    cases.extend(far_from_zero());
    cases.extend(splits(effort.select(50, 2000)));
    cases.push(merging_nothing());
    cases.push(uneven_counts());
    cases.push(schedules(effort.select(BATCHES_IN_TESTS, 200)));
    cases
}

/// A store of one pixel, with grey samples and no features.
struct Pixel(Store);

impl Pixel {
    fn new(values: &[f32]) -> Self {
        let mut pixel = Self(Store::new(1, 1, Layout::with_blocks(|_| false), 2, 0));
        pixel.push(values);
        pixel
    }

    fn push(&mut self, values: &[f32]) {
        const BATCH: usize = 4096;
        for values in values.chunks(BATCH) {
            let samples: Vec<f32> = values.iter().flat_map(|&v| [0.0, 0.0, v, v, v]).collect();
            self.0.push(0, 0, &samples);
        }
    }

    fn moments(&self, part: Part) -> Moments {
        self.0.rows()[0].moments(0, 2, part)
    }
}

/// Mean and unbiased variance in two passes.
fn two_pass(values: &[f32]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let squares: f64 = values.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum();
    (mean, if values.len() < 2 { 0.0 } else { squares / (n - 1.0) })
}

/// The larger of the relative errors of mean and variance.
fn error(moments: Moments, values: &[f32]) -> f64 {
    if values.is_empty() {
        return if moments == Moments::default() { 0.0 } else { f64::INFINITY };
    }
    let (mean, variance) = two_pass(values);
    // The sum of squares has the rounding error of its largest term.
    let scale = variance.max(1e-6 * mean * mean).max(f64::MIN_POSITIVE);
    largest([relative(moments.mean, mean), (moments.variance() - variance).abs() / scale])
}

fn one_sample() -> Case {
    let moments = Pixel::new(&[0.3]).moments(Part::Whole);
    let off = (moments.mean - f64::from(0.3f32)).abs() + moments.variance();
    Case::new("one sample", "error of mean and variance 0", Exactly(0.0), off)
}

fn two_equal_samples() -> Case {
    let variance = Pixel::new(&[0.1, 0.1]).moments(Part::Whole).variance();
    Case::new("two equal samples", "variance", Exactly(0.0), variance)
}

fn many_samples(count: usize) -> Case {
    let mut rng = Pcg64::seed_from_u64(3);
    let values: Vec<f32> = (0..count).map(|_| 0.5 + rng.random::<f32>()).collect();
    let off = error(Pixel::new(&values).moments(Part::Whole), &values);
    Case::new(format!("{count} samples"), "relative error against a two-pass computation", AtMost(3e-4), off)
}

fn far_from_zero() -> [Case; 2] {
    // f32 rounds the uniform values to steps of 0.0625 and 8.
    [
        (1e6, 1.0, 0.0625, "standard deviation 1 around 10⁶"),
        (1e8, 40.0, 8.0, "standard deviation 40 around 10⁸"),
    ]
    .map(|(mean, deviation, step, name)| {
        let mut rng = Pcg64::seed_from_u64(5);
        let width = 12f32.sqrt() * deviation;
        let values: Vec<f32> = (0..100_000).map(|_| mean + width * (rng.random::<f32>() - 0.5)).collect();
        let expected = f64::from(deviation * deviation + step * step / 12.0).sqrt();
        let measured = Pixel::new(&values).moments(Part::Whole).variance().sqrt();
        Case::new(name, "relative error of σ", AtMost(0.01), relative(measured, expected))
    })
}

/// Log-uniform values over six orders of magnitude.
fn log_uniform(rng: &mut Pcg64, count: usize) -> Vec<f32> {
    (0..count).map(|_| 10f32.powf(rng.random_range(-3.0..3.0))).collect()
}

/// Merges the stores of a stream's pieces in any order.
fn splits(trials: usize) -> [Case; 2] {
    let mut rng = Pcg64::seed_from_u64(11);
    let (mut whole, mut halves) = (0.0f64, 0.0f64);
    for _ in 0..trials {
        let count = rng.random_range(1..2000);
        let values = log_uniform(&mut rng, count);
        let stream = Pixel::new(&values);
        let mut pieces: Vec<Pixel> = Vec::new();
        let mut rest = &values[..];
        while !rest.is_empty() {
            // Pieces of even length keep each sample in its half.
            let length = (2 * rng.random_range(1..=200)).min(rest.len());
            let (piece, others) = rest.split_at(length);
            pieces.push(Pixel::new(piece));
            rest = others;
        }
        let mut merged = Pixel::new(&[]);
        while !pieces.is_empty() {
            let index = rng.random_range(0..pieces.len());
            merged.0.merge(&pieces.swap_remove(index).0);
        }
        let off = |part: Part| {
            let (m, s) = (merged.moments(part), stream.moments(part));
            let scale = (s.m2.max(1e-6 * s.mean * s.mean)).max(f64::MIN_POSITIVE);
            let counts = if m.count == s.count { 0.0 } else { f64::INFINITY };
            largest([relative(m.mean, s.mean), (m.m2 - s.m2).abs() / scale, counts])
        };
        whole = largest([whole, off(Part::Whole)]);
        halves = largest([halves, off(Part::Half(0)), off(Part::Half(1))]);
    }
    [
        Case::new("any split, merged in any order", "relative difference", AtMost(ROUNDING), whole),
        Case::new("the same, of halves", "relative difference", AtMost(ROUNDING), halves),
    ]
}

fn merging_nothing() -> Case {
    let mut pixel = Pixel::new(&[0.25, 4.0, 1.5]);
    let before = [Part::Whole, Part::Half(0), Part::Half(1)].map(|part| pixel.moments(part));
    pixel.0.merge(&Pixel::new(&[]).0);
    let after = [Part::Whole, Part::Half(0), Part::Half(1)].map(|part| pixel.moments(part));
    let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    Case::new("merging with an empty store", "changed moments", Exactly(0.0), changed as f64)
}

fn uneven_counts() -> Case {
    const COUNTS: [usize; 8] = [1, 10_000, 2, 9999, 100, 1, 0, 3];
    let mut store = Store::new(COUNTS.len(), 1, Layout::with_blocks(|_| false), 2, 0);
    let mut rng = Pcg64::seed_from_u64(13);
    let off = COUNTS.iter().enumerate().map(|(x, &count)| {
        let values = log_uniform(&mut rng, count);
        let samples: Vec<f32> = values.iter().flat_map(|&v| [0.0, 0.0, v, v, v]).collect();
        store.push(x, 0, &samples);
        error(store.rows()[0].moments(x, 4, Part::Whole), &values)
    });
    let off = largest(off.collect::<Vec<_>>());
    Case::new(
        "neighbouring pixels with 0 to 10 000 samples",
        "relative error against a two-pass computation",
        AtMost(ROUNDING),
        off,
    )
}

/// Pushes batches of random sizes, with invalid samples among them.
fn schedules(batches: usize) -> Case {
    const PIXELS: usize = 6;
    let mut store = Store::new(PIXELS, 1, Layout::with_blocks(|_| false), 2, 0);
    let mut valid = vec![[Vec::new(), Vec::new()]; PIXELS];
    let mut taken = [0usize; PIXELS];
    let mut rng = Pcg64::seed_from_u64(17);
    for _ in 0..batches {
        for x in 0..PIXELS {
            // Log-uniform counts; one in 16 batches is empty
            let count = 10f64.powf(rng.random_range(0.0..4.0)) as usize;
            let count = if rng.random_range(0..16) == 0 { 0 } else { count };
            let mut values = log_uniform(&mut rng, count);
            for value in &mut values {
                if rng.random_range(0..50) == 0 {
                    *value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0][rng.random_range(0..4)];
                }
                if value.is_finite() && *value >= 0.0 {
                    valid[x][taken[x] & 1].push(*value);
                }
                taken[x] += 1;
            }
            let samples: Vec<f32> = values.iter().flat_map(|&v| [0.0, 0.0, v, v, v]).collect();
            store.push(x, 0, &samples);
        }
    }
    let row = &store.rows()[0];
    let off = (0..PIXELS).flat_map(|x| {
        let whole = valid[x].concat();
        let halves = [0, 1].map(|h| error(row.moments(x, 3, Part::Half(h)), &valid[x][h]));
        [error(row.moments(x, 3, Part::Whole), &whole), halves[0], halves[1]]
    });
    let off = largest(off.collect::<Vec<_>>());
    let name = format!("{batches} batches of 0 to 10⁴ samples per pixel, some of them invalid");
    // Errors of single steps are independent, so that their sum grows with the root of the samples
    let rounding = ROUNDING * (batches as f64 / BATCHES_IN_TESTS as f64).sqrt();
    Case::new(name, "relative error against a two-pass computation", AtMost(rounding), off)
}
