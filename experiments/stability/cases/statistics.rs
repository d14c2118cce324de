//! Moments, their merging, and neighbours of unlike counts.

use prpf::stats::{Layout, Moments, Part, Store};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::Bound::{AtMost, Exactly};
use super::{Case, Effort, largest, relative};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = vec![one_sample(), two_equal_samples(), many_samples(effort.of(10_000_000, 100_000_000))];
    cases.extend(far_from_zero());
    cases.extend(splits(effort.of(50, 2000)));
    cases.push(merging_nothing());
    cases.push(unlike_neighbours());
    cases.push(schedules(effort.of(8, 200)));
    cases
}

/// One pixel of bare samples, all three colours alike.
struct Pixel(Store);

impl Pixel {
    fn of(values: &[f32]) -> Self {
        let mut pixel = Self(Store::new(1, 1, Layout::with_blocks(|_| false), 2, 0));
        pixel.push(values);
        pixel
    }

    fn push(&mut self, values: &[f32]) {
        const AT_ONCE: usize = 4096;
        for values in values.chunks(AT_ONCE) {
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
    // The sum of squares is known to the rounding of the largest of them.
    let scale = variance.max(1e-6 * mean * mean).max(f64::MIN_POSITIVE);
    largest([relative(moments.mean, mean), (moments.variance() - variance).abs() / scale])
}

fn one_sample() -> Case {
    let moments = Pixel::of(&[0.3]).moments(Part::Whole);
    let off = (moments.mean - f64::from(0.3f32)).abs() + moments.variance();
    Case::new("one sample", "error of mean and variance 0", Exactly(0.0), off)
}

fn two_equal_samples() -> Case {
    let variance = Pixel::of(&[0.1, 0.1]).moments(Part::Whole).variance();
    Case::new("two equal samples", "variance", Exactly(0.0), variance)
}

fn many_samples(count: usize) -> Case {
    let mut numbers = Pcg64::seed_from_u64(3);
    let values: Vec<f32> = (0..count).map(|_| 0.5 + numbers.random::<f32>()).collect();
    let off = error(Pixel::of(&values).moments(Part::Whole), &values);
    Case::new(format!("{count} samples"), "relative error beside two passes", AtMost(1e-9), off)
}

fn far_from_zero() -> [Case; 2] {
    // Steps of f32 are 0.06 and 8 wide there: what is uniform is rounded to them.
    [(1e6, 1.0, 0.0625, "deviation 1 around 10⁶"), (1e8, 40.0, 8.0, "deviation 40 around 10⁸")].map(
        |(mean, deviation, step, name)| {
            let mut numbers = Pcg64::seed_from_u64(5);
            let width = 12f32.sqrt() * deviation;
            let values: Vec<f32> =
                (0..100_000).map(|_| mean + width * (numbers.random::<f32>() - 0.5)).collect();
            let expected = f64::from(deviation * deviation + step * step / 12.0).sqrt();
            let measured = Pixel::of(&values).moments(Part::Whole).variance().sqrt();
            Case::new(name, "relative error of σ", AtMost(0.01), relative(measured, expected))
        },
    )
}

/// Values over six orders of magnitude.
fn wild(numbers: &mut Pcg64, count: usize) -> Vec<f32> {
    (0..count).map(|_| 10f32.powf(numbers.random_range(-3.0..3.0))).collect()
}

/// A stream cut into any number of stores that are merged in any order.
fn splits(trials: usize) -> [Case; 2] {
    let mut numbers = Pcg64::seed_from_u64(11);
    let (mut whole, mut halves) = (0.0f64, 0.0f64);
    for _ in 0..trials {
        let count = numbers.random_range(1..2000);
        let values = wild(&mut numbers, count);
        let stream = Pixel::of(&values);
        let mut pieces: Vec<Pixel> = Vec::new();
        let mut rest = &values[..];
        while !rest.is_empty() {
            // Even, so that each sample keeps its half.
            let length = (2 * numbers.random_range(1..=200)).min(rest.len());
            let (piece, others) = rest.split_at(length);
            pieces.push(Pixel::of(piece));
            rest = others;
        }
        let mut merged = Pixel::of(&[]);
        while !pieces.is_empty() {
            let any = numbers.random_range(0..pieces.len());
            merged.0.merge(&pieces.swap_remove(any).0);
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
        Case::new("any split, merged in any order", "relative difference", AtMost(1e-11), whole),
        Case::new("the same, of halves", "relative difference", AtMost(1e-11), halves),
    ]
}

fn merging_nothing() -> Case {
    let mut pixel = Pixel::of(&[0.25, 4.0, 1.5]);
    let before = [Part::Whole, Part::Half(0), Part::Half(1)].map(|part| pixel.moments(part));
    pixel.0.merge(&Pixel::of(&[]).0);
    let after = [Part::Whole, Part::Half(0), Part::Half(1)].map(|part| pixel.moments(part));
    let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    Case::new("merging with an empty store", "moments changed", Exactly(0.0), changed as f64)
}

fn unlike_neighbours() -> Case {
    const COUNTS: [usize; 8] = [1, 10_000, 2, 9999, 100, 1, 0, 3];
    let mut store = Store::new(COUNTS.len(), 1, Layout::with_blocks(|_| false), 2, 0);
    let mut numbers = Pcg64::seed_from_u64(13);
    let off = COUNTS.iter().enumerate().map(|(x, &count)| {
        let values = wild(&mut numbers, count);
        let samples: Vec<f32> = values.iter().flat_map(|&v| [0.0, 0.0, v, v, v]).collect();
        store.push(x, 0, &samples);
        error(store.rows()[0].moments(x, 4, Part::Whole), &values)
    });
    let off = largest(off.collect::<Vec<_>>());
    Case::new("0 to 10 000 samples in neighbours", "relative error beside two passes", AtMost(1e-10), off)
}

/// Batches of any size in any order of pixels, bad samples among them.
fn schedules(batches: usize) -> Case {
    const PIXELS: usize = 6;
    let mut store = Store::new(PIXELS, 1, Layout::with_blocks(|_| false), 2, 0);
    let mut seen = vec![[Vec::new(), Vec::new()]; PIXELS];
    let mut drawn = [0usize; PIXELS];
    let mut numbers = Pcg64::seed_from_u64(17);
    for _ in 0..batches {
        for x in 0..PIXELS {
            // As many of few samples as of many; one in 16 pixels gets none.
            let most = 10f64.powf(numbers.random_range(0.0..4.0)) as usize;
            let count = if numbers.random_range(0..16) == 0 { 0 } else { most };
            let mut values = wild(&mut numbers, count);
            for value in &mut values {
                if numbers.random_range(0..50) == 0 {
                    *value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0][numbers.random_range(0..4)];
                }
                if value.is_finite() && *value >= 0.0 {
                    seen[x][drawn[x] & 1].push(*value);
                }
                drawn[x] += 1;
            }
            let samples: Vec<f32> = values.iter().flat_map(|&v| [0.0, 0.0, v, v, v]).collect();
            store.push(x, 0, &samples);
        }
    }
    let row = &store.rows()[0];
    let off = (0..PIXELS).flat_map(|x| {
        let whole = seen[x].concat();
        let halves = [0, 1].map(|h| error(row.moments(x, 3, Part::Half(h)), &seen[x][h]));
        [error(row.moments(x, 3, Part::Whole), &whole), halves[0], halves[1]]
    });
    let off = largest(off.collect::<Vec<_>>());
    let name = format!("{batches} batches of 0 to 10⁴ samples per pixel, some of them bad");
    Case::new(name, "relative error beside two passes", AtMost(1e-10), off)
}
