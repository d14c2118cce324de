//! Owen-scrambled Sobol' points, padded: every set of four dimensions is the first four Sobol' dimensions with
//! its own scramble and shuffle (Burley 2020, "Practical Hash-based Owen Scrambling").
//!
//! The pixels of a tile share their scrambles and shuffles, and each shifts the points by digits of its own so that
//! neighbours complement each other: the first 2ᵏ samples of a half of each pixel in a block of 2ᵐ pixels are together
//! about as evenly spread as 2ᵏ⁺ᵐ points of one sequence, for every k and m at once. The image's error is then close to blue
//! noise, of which a filter leaves less than of white noise. The idea, for a number of samples that is known in advance,
//! is that of Ahmed and Wonka 2020, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical
//! Ordering of Pixels". Each pixel's own points are as evenly spread as without shifts. The tiles of each set have a
//! random origin: where two sets complement the same neighbours, the errors of a product of their values do not cancel.
//!
//! The two halves of a pixel's samples (even and odd index) are scrambled independently, so that the variance
//! between halves is the estimator's and not that of parts of one net. A sequence has 2¹⁶ points, as in the
//! crate `sobol_burley`; samples beyond start further sequences with further scrambles.
//!
//! Points, scrambles and hashes are those of `sobol_burley::sample_4d`. Only the product with the generator
//! matrices is looked up byte by byte instead of computed bit by bit, which makes a set three times as fast.

use std::sync::LazyLock;

use sobol_burley::parts;

use super::sample_address::{SampleAddress, SampleAddresses};
use super::sampler::{SET_SIZE, Sampler, ValueSet};
use crate::hash::hash;
use crate::simd::{LANES, Lanes, apply, multiversioned};

/// log₂ of the length of one sequence.
const SEQUENCE_BITS: u32 = 16;

/// Bit at which the lowest byte of a bit-reversed index begins.
const REVERSED_START: u32 = u32::BITS - SEQUENCE_BITS;

/// log₂ of a tile's side in pixels.
const TILE_SIDE_BITS: u32 = 4;

/// log₂ of a tile's pixels.
const PLACE_BITS: u32 = 2 * TILE_SIDE_BITS;
const _: () = assert!(PLACE_BITS == u8::BITS, "tables and bit reversals are made for a place of one byte");

/// Digits by which a pixel's points are shifted for each bit of its place along the tile's Morton curve, the lowest
/// bit first: `[dimension][bit]`, bit-reversed as the points.
///
/// With them the generator matrices of the first two dimensions, for blocks of 2¹ to 2⁸ pixels and 2⁰ to 2⁶ samples,
/// miss full rank by at most one, in most shapes of cells by none. None in all would make index, place and both values a
/// (0, m, 4)-net in base 2, which does not exist. The other pairs of the four dimensions miss more, as Sobol' points
/// themselves do. `experiments/sampler/pixel_shifts.py` searches for such shifts.
const PLACE_SHIFTS: [[u32; PLACE_BITS as usize]; SET_SIZE as usize] = [
    [0x6e7f, 0xd3aa, 0x3f59, 0x93ee, 0x909a, 0x47b3, 0x66a8, 0x294a],
    [0xf6ff, 0xe755, 0x7b33, 0x7cdb, 0xa36f, 0x644f, 0x340b, 0xc772],
    [0x9bfe, 0x1555, 0x2ecc, 0xd1d1, 0xd0df, 0xb652, 0xb7b3, 0x7e58],
    [0x96fb, 0x48ae, 0xe132, 0x77bf, 0xec39, 0xcb73, 0x6c8a, 0x5a51],
];

/// Bit-reversed points of one byte's values.
type Points = [[u32; SET_SIZE as usize]; 256];

/// Points whose sum over GF(2) is a sample's, before it is scrambled.
struct Tables {
    /// Points of indices whose bits are 0 outside of one byte: `[byte][value]`, where `value` is the byte of
    /// the bit-reversed index and byte 0 is the lower one.
    indices: [Points; (SEQUENCE_BITS / 8) as usize],
    /// Shifts by bit-reversed place.
    shifts: Points,
}

static TABLES: LazyLock<Box<Tables>> = LazyLock::new(|| {
    let point = |reversed_index| std::array::from_fn(|d| parts::sobol_rev(reversed_index, d as u32));
    let byte = |byte: usize| {
        std::array::from_fn(|value| point((value as u32) << (REVERSED_START as usize + 8 * byte)))
    };
    let shift = |place: u8| {
        PLACE_SHIFTS.map(|bits| {
            let set = bits.iter().enumerate().filter(|(bit, _)| place >> bit & 1 == 1);
            set.fold(0, |sum, (_, shift)| sum ^ shift)
        })
    };
    let shifts = std::array::from_fn(|reversed_place| shift((reversed_place as u8).reverse_bits()));
    Box::new(Tables { indices: std::array::from_fn(byte), shifts })
});

/// Samples one pixel with Owen-scrambled Sobol' points.
#[derive(Clone, Copy)]
pub struct Sobol {
    /// Keys of even and odd sample indices.
    halves: [u64; 2],
    pixel: u32,
}

impl Sampler for Sobol {
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self {
        let key = hash(seed);
        Self { halves: [key, hash(key)], pixel: y << 16 | x & 0xffff }
    }

    #[inline]
    fn address(&self, index: u32) -> SampleAddress {
        SampleAddress { key: self.halves[(index & 1) as usize], pixel: self.pixel, index: index >> 1 }
    }

    #[inline]
    fn values(samples: &SampleAddresses, sets: &Lanes<u32>, values: &mut ValueSet) {
        scrambled_points(&TABLES, samples, sets, values);
    }
}

/// Returns how far the tiles of a set are shifted to the left and up, in pixels: the upper bits of a hash by the multipliers of
/// xxHash32 and MurmurHash3.
#[inline(always)]
fn tile_origin(key: u64, set: u32) -> [u32; 2] {
    let random = (key as u32 ^ set.wrapping_mul(0x9e37_79b1)).wrapping_mul(0x85eb_ca6b);
    [0, 1].map(|axis| random >> (32 - (axis + 1) * TILE_SIDE_BITS) & ((1 << TILE_SIDE_BITS) - 1))
}

/// Returns a number for each tile, sequence and set. The sequences of sets beyond 2¹⁶ share some.
#[inline(always)]
fn scramble_number(tile: u32, sequence: u32, set: u32) -> u64 {
    u64::from(tile) << 32 | u64::from(sequence << 16 ^ set)
}

/// Computes `sobol_burley::sample_4d(index, 0, seed)`, with a seed of key, tile, sequence and set, and shifts it by the
/// digits of the pixel's place. The constants are that crate's.
#[apply(multiversioned!)]
fn scrambled_points(tables: &Tables, samples: &SampleAddresses, sets: &Lanes<u32>, values: &mut ValueSet) {
    const SHUFFLE: u32 = 0x79c6_8e4a;
    const SPREAD: u32 = 0x9c8f_2d3b;
    const SCRAMBLES: [u32; SET_SIZE as usize] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];
    // Find the set's tile and the pixel's place in it
    let (mut tiles, mut reversed_places): (Lanes<u32>, Lanes<u32>) = ([0; LANES], [0; LANES]);
    for lane in 0..LANES {
        let [left, top] = tile_origin(samples.keys[lane], sets[lane]);
        let (x, y) = (left + (samples.pixels[lane] & 0xffff), top + (samples.pixels[lane] >> 16));
        tiles[lane] = (y >> TILE_SIDE_BITS) << 16 | x >> TILE_SIDE_BITS;
        // Bit-reversed, and every second bit
        let spread = |v: u32| (v & 1) << 6 | (v & 2) << 3 | v & 4 | (v & 8) >> 3;
        reversed_places[lane] = spread(x) << 1 | spread(y);
    }
    // Hash the addresses to seeds
    let (mut seeds, mut place_seeds): (Lanes<u32>, Lanes<u32>) = ([0; LANES], [0; LANES]);
    for lane in 0..LANES {
        let sequence = samples.indices[lane] >> SEQUENCE_BITS;
        let seed = hash(samples.keys[lane] ^ scramble_number(tiles[lane], sequence, sets[lane]));
        (seeds[lane], place_seeds[lane]) = ((seed >> 32) as u32, seed as u32);
    }
    // Shuffle the sequence, and permute the places within blocks
    let (mut shuffled, mut places): (Lanes<u32>, Lanes<u32>) = ([0; LANES], [0; LANES]);
    for lane in 0..LANES {
        let index = samples.indices[lane] & ((1 << SEQUENCE_BITS) - 1);
        shuffled[lane] = parts::owen_scramble_rev(index.reverse_bits(), parts::hash(seeds[lane] ^ SHUFFLE));
        places[lane] = parts::owen_scramble_rev(reversed_places[lane], place_seeds[lane]);
    }
    // Look up and add the points
    let ([low, high], shifts) = (&tables.indices, &tables.shifts);
    let mut points = [[0; LANES]; SET_SIZE as usize];
    for lane in 0..LANES {
        let low = &low[(shuffled[lane] >> REVERSED_START & 0xff) as usize];
        let high = &high[(shuffled[lane] >> (REVERSED_START + 8)) as usize];
        let shift = &shifts[(places[lane] & 0xff) as usize];
        for d in 0..SET_SIZE as usize {
            points[d][lane] = low[d] ^ high[d] ^ shift[d];
        }
    }
    // Scramble each dimension
    for d in 0..SET_SIZE as usize {
        let lanes = &mut values[d];
        for lane in 0..LANES {
            let scramble = parts::hash(seeds[lane].wrapping_mul(SPREAD) ^ SCRAMBLES[d]);
            let scrambled = parts::owen_scramble_rev(points[d][lane], scramble);
            lanes[lane] = parts::u32_to_f32_norm(scrambled.reverse_bits());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::value;
    use super::*;

    /// Counts points in `w` by `h` cells over the first two dimensions of a set.
    fn occupancy(points: impl Iterator<Item = [f32; 2]>, w: usize, h: usize) -> Vec<u32> {
        let mut cells = vec![0; w * h];
        for [x, y] in points {
            cells[(y * h as f32) as usize * w + (x * w as f32) as usize] += 1;
        }
        cells
    }

    /// Returns the first two values that a set has for a sample of one half.
    fn point(sampler: &Sobol, index: u32, half: u32, set: u32) -> [f32; 2] {
        [0, 1].map(|d| value(sampler, 2 * index + half, SET_SIZE * set + d))
    }

    #[test]
    fn each_half_is_a_zero_two_sequence_in_every_set() {
        let sampler = Sobol::for_pixel(11, 2, 3);
        for (half, set) in [(0, 0), (1, 0), (0, 1), (1, 100)] {
            for start in [0, 64, 1 << 16, (5_000_000 >> 6) << 6] {
                let points = (start..start + 64).map(|i| point(&sampler, i, half, set));
                for log_w in 0..=6 {
                    let (w, h) = (1 << log_w, 1 << (6 - log_w));
                    assert!(occupancy(points.clone(), w, h).iter().all(|&n| n == 1));
                }
            }
        }
    }

    /// Returns the samplers of the pixels in a block in the last corner of one of a set's tiles.
    fn block(seed: u64, half: usize, set: u32, w: u32, h: u32) -> impl Iterator<Item = Sobol> {
        let [left, top] = tile_origin(Sobol::for_pixel(seed, 0, 0).halves[half], set);
        let (x, y) = (48 - left - w, 32 - top - h);
        (0..w * h).map(move |i| Sobol::for_pixel(seed, x + i % w, y + i / w))
    }

    /// A block of 2ᵐ pixels begins at a multiple of 2ᵐ on the Morton curve: it is a square or two.
    #[test]
    fn neighbouring_pixels_complement_each_other() {
        let (mut shapes, mut uneven) = (0, 0);
        for (block_bits, sample_bits) in (0..=8_u32).flat_map(|m| (0..=4).map(move |k| (m, k))) {
            let (w, h) = (1 << block_bits.div_ceil(2), 1 << (block_bits / 2));
            let points: Vec<[f32; 2]> = block(5, 0, 3, w, h)
                .flat_map(|pixel| (0..1 << sample_bits).map(move |i| point(&pixel, i, 0, 3)))
                .collect();
            let bits = block_bits + sample_bits;
            for log_w in 0..=bits {
                let counts = occupancy(points.iter().copied(), 1 << log_w, 1 << (bits - log_w));
                assert!(counts.iter().all(|&n| n <= 2), "{block_bits} {sample_bits} {log_w}");
                shapes += 1;
                uneven += usize::from(counts.contains(&0));
            }
        }
        // Random shifts leave 71 % uneven.
        assert!(uneven * 4 < shapes, "{uneven} of {shapes}");
    }

    #[test]
    fn pixels_and_tiles_differ() {
        let at = |x, y| point(&Sobol::for_pixel(11, x, y), 0, 0, 1);
        let differ = |a: [f32; 2], b: [f32; 2]| a[0] != b[0] && a[1] != b[1];
        assert!(differ(at(40, 40), at(41, 40)) && differ(at(40, 40), at(40, 41)));
        assert!(differ(at(40, 40), at(40 + 16, 40)) && differ(at(40, 40), at(40, 40 + 16)));
    }

    /// χ² with 63 degrees of freedom exceeds 125 with a probability of 5·10⁻⁶.
    #[test]
    fn a_pixel_s_values_are_uniform_over_seeds() {
        for (index, set) in [(0, 0), (1, 0), (2, 1)] {
            let points = (0..4096).map(|seed| point(&Sobol::for_pixel(seed, 3, 5), index, 0, set));
            let chi_squared: f64 =
                occupancy(points, 8, 8).iter().map(|&n| (f64::from(n) - 64.0).powi(2) / 64.0).sum();
            assert!(chi_squared < 125.0, "{chi_squared}");
        }
    }

    #[test]
    fn points_are_those_of_the_crate() {
        // Each set has one pixel in a tile whose place is 0, and whose points are not shifted.
        for (half, set) in [(0, 0), (1, 0), (0, 4), (1, 7)] {
            let expected = |sampler: &Sobol, i| {
                let number = scramble_number(1 << 16 | 2, 0, set);
                sobol_burley::sample_4d(i, 0, (hash(sampler.halves[half] ^ number) >> 32) as u32)
            };
            let found = |sampler: &Sobol, i: u32| {
                [0, 1, 2, 3].map(|d| value(sampler, 2 * i + half as u32, SET_SIZE * set + d))
            };
            let equal = block(9, half, set, 16, 16).filter(|sampler| {
                (0..1 << SEQUENCE_BITS).step_by(4001).all(|i| found(sampler, i) == expected(sampler, i))
            });
            assert_eq!(equal.count(), 1, "{half} {set}");
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
