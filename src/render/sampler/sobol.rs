//! Owen-scrambled Sobol' points, padded: every set of four dimensions is the first four Sobol'
//! dimensions with a scramble and a shuffle of its own (Burley 2020, "Practical Hash-based Owen
//! Scrambling").
//!
//! The two halves of a pixel's samples (even and odd index) are scrambled independently, so that
//! the variance between halves is that of the estimator and not of a part of a net. The crate's
//! sequence has 2¹⁶ points; the samples beyond start further sequences with further scrambles.

use super::{SET, Source, hash, pixel_key};

/// log₂ of the length of one sequence.
const SEQUENCE_BITS: u32 = 16;

/// See the module.
pub struct Sobol {
    halves: [u64; 2],
}

impl Source for Sobol {
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self {
        let key = pixel_key(seed, x, y);
        Self { halves: [key, hash(key)] }
    }

    #[inline]
    fn numbers(&self, index: u32, set: u32) -> [f32; SET as usize] {
        let half = self.halves[(index & 1) as usize];
        let index = index >> 1;
        let sequence = index >> SEQUENCE_BITS;
        let scramble = hash(half ^ (u64::from(sequence) << 32 | u64::from(set)));
        sobol_burley::sample_4d(index & ((1 << SEQUENCE_BITS) - 1), 0, (scramble >> 32) as u32)
    }
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
