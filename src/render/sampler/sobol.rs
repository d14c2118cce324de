//! Owen-scrambled Sobol' points, padded: every set of four dimensions is the first four Sobol'
//! dimensions with a scramble and a shuffle of its own (Burley 2020, "Practical Hash-based Owen
//! Scrambling").
//!
//! The two halves of a pixel's samples (even and odd index) are scrambled independently, so that
//! the variance between halves is that of the estimator and not of a part of a net. The crate's
//! sequence has 2¹⁶ points; the samples beyond start further sequences with further scrambles.
//!
//! Points, scrambles and hashes are those of `sobol_burley::sample_4d`; only the product with the
//! generator matrices is looked up a byte at a time instead of bit by bit, which makes a set of
//! numbers three times as fast.

use std::sync::LazyLock;

use multiversion::multiversion;
use sobol_burley::parts;

use super::{SET, Source, hash, pixel_key};

/// log₂ of the length of one sequence.
const SEQUENCE_BITS: u32 = 16;

/// Bit-reversed points of indices whose bits are zero outside of one byte: `[byte][value]`, where
/// the value is that of the bit-reversed index and byte 0 is its lower one.
type BytePoints = [[[u32; SET as usize]; 256]; (SEQUENCE_BITS / 8) as usize];

static BYTE_POINTS: LazyLock<Box<BytePoints>> = LazyLock::new(|| {
    let point = |reversed_index| std::array::from_fn(|d| parts::sobol_rev(reversed_index, d as u32));
    let byte = |byte: usize| {
        std::array::from_fn(|value| point((value as u32) << (SEQUENCE_BITS as usize + 8 * byte)))
    };
    Box::new(std::array::from_fn(byte))
});

/// See the module.
#[derive(Clone, Copy)]
pub struct Sobol {
    points: &'static BytePoints,
    halves: [u64; 2],
}

impl Source for Sobol {
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self {
        let key = pixel_key(seed, x, y);
        Self { points: &BYTE_POINTS, halves: [key, hash(key)] }
    }

    #[inline]
    fn numbers(&self, index: u32, set: u32) -> [f32; SET as usize] {
        let half = self.halves[(index & 1) as usize];
        let index = index >> 1;
        let sequence = index >> SEQUENCE_BITS;
        let seed = hash(half ^ (u64::from(sequence) << 32 | u64::from(set)));
        scrambled(self.points, index & ((1 << SEQUENCE_BITS) - 1), (seed >> 32) as u32)
    }
}

/// `sobol_burley::sample_4d(index, 0, seed)`; its constants are repeated here. The four dimensions are
/// the lanes of a vector.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn scrambled(points: &BytePoints, index: u32, seed: u32) -> [f32; SET as usize] {
    const SHUFFLE: u32 = 0x79c6_8e4a;
    const SPREAD: u32 = 0x9c8f_2d3b;
    const SCRAMBLES: [u32; SET as usize] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];
    let shuffled = parts::owen_scramble_rev(index.reverse_bits(), parts::hash(seed ^ SHUFFLE));
    let low = &points[0][(shuffled >> SEQUENCE_BITS) as usize & 0xff];
    let high = &points[1][(shuffled >> (SEQUENCE_BITS + 8)) as usize];
    let spread = seed.wrapping_mul(SPREAD);
    let mut numbers = [0.0; SET as usize];
    for (d, number) in numbers.iter_mut().enumerate() {
        let scramble = parts::hash(spread ^ SCRAMBLES[d]);
        let scrambled = parts::owen_scramble_rev(low[d] ^ high[d], scramble);
        *number = parts::u32_to_f32_norm(scrambled.reverse_bits());
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts points of a range of one half in a grid of `w` by `h` cells over two dimensions.
    fn occupancy(half: u32, range: std::ops::Range<u32>, set: u32, w: usize, h: usize) -> Vec<u32> {
        let source = Sobol::for_pixel(11, 2, 3);
        let mut cells = vec![0; w * h];
        for i in range {
            let [x, y, ..] = source.numbers(2 * i + half, set);
            cells[(y * h as f32) as usize * w + (x * w as f32) as usize] += 1;
        }
        cells
    }

    #[test]
    fn each_half_is_a_zero_two_sequence_in_every_set() {
        for (half, set) in [(0, 0), (1, 0), (0, 1), (1, 100)] {
            for start in [0, 64, 1 << 16, (5_000_000 >> 6) << 6] {
                for log_w in 0..=6 {
                    let (w, h) = (1 << log_w, 1 << (6 - log_w));
                    assert!(occupancy(half, start..start + 64, set, w, h).iter().all(|&n| n == 1));
                }
            }
        }
    }

    #[test]
    fn points_are_those_of_the_crate() {
        let source = Sobol::for_pixel(0, 0, 0);
        for i in (0..1 << SEQUENCE_BITS).step_by(41) {
            assert_eq!(scrambled(source.points, i, i), sobol_burley::sample_4d(i, 0, i));
        }
    }

    #[test]
    fn halves_sets_and_sequences_differ() {
        let source = Sobol::for_pixel(11, 2, 3);
        let base = source.numbers(0, 0);
        for (index, set) in [(1, 0), (0, 1), (2 << SEQUENCE_BITS, 0)] {
            assert!(base.iter().zip(source.numbers(index, set)).all(|(a, b)| *a != b), "{index} {set}");
        }
    }

    #[test]
    fn halves_are_uncorrelated() {
        let source = Sobol::for_pixel(4, 0, 0);
        let n = 4096;
        let sum: f64 = (0..n)
            .map(|i| {
                let (a, b) = (source.numbers(2 * i, 0)[0], source.numbers(2 * i + 1, 0)[0]);
                f64::from(a - 0.5) * f64::from(b - 0.5)
            })
            .sum();
        let correlation = sum / f64::from(n) * 12.0;
        assert!(correlation.abs() < 5.0 / f64::from(n).sqrt(), "{correlation}");
    }
}
