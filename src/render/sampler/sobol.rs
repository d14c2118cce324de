//! Owen-scrambled Sobol' points, padded: every set of four dimensions is the first four Sobol' dimensions with
//! its own scramble and shuffle (Burley 2020, "Practical Hash-based Owen Scrambling").
//!
//! The two halves of a pixel's samples (even and odd index) are scrambled independently, so that the variance
//! between halves is the estimator's and not that of parts of one net. A sequence has 2¹⁶ points, as in the
//! crate `sobol_burley`; samples beyond start further sequences with further scrambles.
//!
//! Points, scrambles and hashes are those of `sobol_burley::sample_4d`. Only the product with the generator
//! matrices is looked up byte by byte instead of computed bit by bit, which makes a set three times as fast.

use std::sync::LazyLock;

use sobol_burley::parts;

use super::sample_address::{SampleAddress, SampleAddresses, pixel_key};
use super::sampler::{SET_SIZE, Sampler, ValueSet};
use crate::hash::hash;
use crate::simd::{LANES, Lanes, apply, multiversioned};

/// log₂ of the length of one sequence.
const SEQUENCE_BITS: u32 = 16;

/// Bit-reversed points of indices whose bits are 0 outside of one byte: `[byte][value]`, where `value` is the
/// byte of the bit-reversed index and byte 0 is the lower one.
type BytePoints = [[[u32; SET_SIZE as usize]; 256]; (SEQUENCE_BITS / 8) as usize];

static BYTE_POINTS: LazyLock<Box<BytePoints>> = LazyLock::new(|| {
    let point = |reversed_index| std::array::from_fn(|d| parts::sobol_rev(reversed_index, d as u32));
    let byte = |byte: usize| {
        std::array::from_fn(|value| point((value as u32) << (SEQUENCE_BITS as usize + 8 * byte)))
    };
    Box::new(std::array::from_fn(byte))
});

/// Samples one pixel with Owen-scrambled Sobol' points.
#[derive(Clone, Copy)]
pub struct Sobol {
    /// Keys of even and odd sample indices.
    halves: [u64; 2],
}

impl Sampler for Sobol {
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self {
        let key = pixel_key(seed, x, y);
        Self { halves: [key, hash(key)] }
    }

    #[inline]
    fn address(&self, index: u32) -> SampleAddress {
        SampleAddress { key: self.halves[(index & 1) as usize], index: index >> 1 }
    }

    #[inline]
    fn values(samples: &SampleAddresses, sets: &Lanes<u32>, values: &mut ValueSet) {
        scrambled_points(&BYTE_POINTS, samples, sets, values);
    }
}

/// Computes `sobol_burley::sample_4d(index, 0, seed)`, with a seed from the rest of the address. The constants
/// are that crate's.
#[apply(multiversioned!)]
fn scrambled_points(
    points: &BytePoints,
    samples: &SampleAddresses,
    sets: &Lanes<u32>,
    values: &mut ValueSet,
) {
    const SHUFFLE: u32 = 0x79c6_8e4a;
    const SPREAD: u32 = 0x9c8f_2d3b;
    const SCRAMBLES: [u32; SET_SIZE as usize] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];
    // Hash the addresses to seeds
    let mut seeds: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        let sequence = u64::from(samples.indices[lane] >> SEQUENCE_BITS);
        seeds[lane] = (hash(samples.keys[lane] ^ (sequence << 32 | u64::from(sets[lane]))) >> 32) as u32;
    }
    // Shuffle the sequence
    let mut shuffled: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        let index = samples.indices[lane] & ((1 << SEQUENCE_BITS) - 1);
        shuffled[lane] = parts::owen_scramble_rev(index.reverse_bits(), parts::hash(seeds[lane] ^ SHUFFLE));
    }
    // Look up and scramble each dimension's point
    let (low, high) = (&points[0], &points[1]);
    for d in 0..SET_SIZE as usize {
        let mut point: Lanes<u32> = [0; LANES];
        for lane in 0..LANES {
            let [low_byte, high_byte] =
                [shuffled[lane] >> SEQUENCE_BITS & 0xff, shuffled[lane] >> (SEQUENCE_BITS + 8)];
            point[lane] = low[low_byte as usize][d] ^ high[high_byte as usize][d];
        }
        let lanes = &mut values[d];
        for lane in 0..LANES {
            let scramble = parts::hash(seeds[lane].wrapping_mul(SPREAD) ^ SCRAMBLES[d]);
            let scrambled = parts::owen_scramble_rev(point[lane], scramble);
            lanes[lane] = parts::u32_to_f32_norm(scrambled.reverse_bits());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::value;
    use super::*;

    /// Counts the points of a range of one half in `w` by `h` cells over two dimensions.
    fn occupancy(half: u32, range: std::ops::Range<u32>, set: u32, w: usize, h: usize) -> Vec<u32> {
        let sampler = Sobol::for_pixel(11, 2, 3);
        let mut cells = vec![0; w * h];
        for i in range {
            let [x, y] = [0, 1].map(|d| value(&sampler, 2 * i + half, SET_SIZE * set + d));
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
        let sampler = Sobol::for_pixel(0, 7, 3);
        for i in (0..1 << SEQUENCE_BITS).step_by(41) {
            let (half, set) = (i & 1, i % 5);
            let seed = (hash(sampler.halves[half as usize] ^ u64::from(set)) >> 32) as u32;
            let expected = sobol_burley::sample_4d(i, 0, seed);
            let found = [0, 1, 2, 3].map(|d| value(&sampler, 2 * i + half, SET_SIZE * set + d));
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn halves_sets_and_sequences_differ() {
        let sampler = Sobol::for_pixel(11, 2, 3);
        for (index, set) in [(1, 0), (0, 1), (2 << SEQUENCE_BITS, 0)] {
            let differs = |d| value(&sampler, 0, d) != value(&sampler, index, SET_SIZE * set + d);
            assert!((0..SET_SIZE).all(differs), "{index} {set}");
        }
    }

    #[test]
    fn halves_are_uncorrelated() {
        let sampler = Sobol::for_pixel(4, 0, 0);
        let n = 4096;
        let sum: f64 = (0..n)
            .map(|i| {
                let (a, b) = (value(&sampler, 2 * i, 0), value(&sampler, 2 * i + 1, 0));
                f64::from(a - 0.5) * f64::from(b - 0.5)
            })
            .sum();
        let correlation = sum / f64::from(n) * 12.0;
        assert!(correlation.abs() < 5.0 / f64::from(n).sqrt(), "{correlation}");
    }
}
