//! Where a sample's numbers come from. They are addressed, not drawn: a number depends on (seed,
//! pixel, sample index, dimension) alone, so an image depends neither on threads nor on batches.

mod dimensions;
mod independent;
mod sobol;

use crate::geometry::{LANES, Lanes};
use crate::stats::hash;

pub use dimensions::{BounceNumbers, Dimensions, Needs};
pub use independent::Independent;
pub use sobol::Sobol;

/// Dimensions are made four at a time, of sixteen samples.
const SET: u32 = 4;

/// Four numbers in [0, 1) of each of sixteen samples.
type NumberSet = [Lanes; SET as usize];

/// The numbers of all samples of one pixel.
pub trait Source: Copy {
    /// The source of the pixel at (`x`, `y`) of the whole image.
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self;

    /// What the numbers of one of the pixel's samples follow from, besides the dimension.
    fn address(&self, index: u32) -> Address;

    /// Dimensions `4 set` to `4 set + 3` of each sample.
    fn numbers(samples: &Addresses, sets: &Lanes<u32>, numbers: &mut NumberSet);
}

/// See [`Source::address`].
#[derive(Clone, Copy)]
pub struct Address {
    pub key: u64,
    pub index: u32,
}

/// Addresses of sixteen samples.
#[derive(Clone, Copy)]
pub struct Addresses {
    keys: Lanes<u64>,
    indices: Lanes<u32>,
}

impl Addresses {
    pub const NONE: Self = Self { keys: [0; LANES], indices: [0; LANES] };

    #[inline(always)]
    pub fn set(&mut self, lane: usize, Address { key, index }: Address) {
        (self.keys[lane], self.indices[lane]) = (key, index);
    }

    #[inline(always)]
    pub fn at(&self, lane: usize) -> Address {
        Address { key: self.keys[lane], index: self.indices[lane] }
    }
}

/// Key of a pixel's numbers.
#[inline]
fn pixel_key(seed: u64, x: u32, y: u32) -> u64 {
    hash(hash(seed) ^ (u64::from(y) << 32 | u64::from(x)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One number, in a lane of its own choice.
    pub(super) fn number<S: Source>(source: &S, index: u32, dimension: u32) -> f32 {
        let (mut samples, mut numbers) = (Addresses::NONE, [[0.0; LANES]; SET as usize]);
        let lane = (index + dimension) as usize % LANES;
        samples.set(lane, source.address(index));
        S::numbers(&samples, &[dimension / SET; LANES], &mut numbers);
        numbers[(dimension % SET) as usize][lane]
    }

    fn all<S: Source>(seed: u64, index: u32) -> Vec<f32> {
        let source = S::for_pixel(seed, 3, 5);
        (0..40).map(|d| number(&source, index, d)).collect()
    }

    #[test]
    fn the_same_address_gives_the_same_number() {
        assert_eq!(all::<Sobol>(1, 9), all::<Sobol>(1, 9));
        assert_eq!(all::<Independent>(1, 9), all::<Independent>(1, 9));
    }

    #[test]
    fn another_seed_or_index_gives_other_numbers() {
        assert!(all::<Sobol>(1, 9).iter().zip(all::<Sobol>(2, 9)).all(|(a, b)| *a != b));
        assert!(all::<Independent>(1, 9).iter().zip(all::<Independent>(1, 10)).all(|(a, b)| *a != b));
    }

    #[test]
    fn numbers_lie_in_the_unit_interval_and_have_its_moments() {
        fn check<S: Source>() {
            let source = S::for_pixel(7, 0, 0);
            let n = 4096;
            for dimension in [0, 1, 17, 1000] {
                let values: Vec<f64> = (0..n).map(|i| f64::from(number(&source, i, dimension))).collect();
                assert!(values.iter().all(|v| (0.0..1.0).contains(v)));
                let mean = values.iter().sum::<f64>() / f64::from(n);
                let square = values.iter().map(|v| v * v).sum::<f64>() / f64::from(n);
                // Five standard errors of independent numbers.
                assert!((mean - 0.5).abs() < 5.0 * (1.0 / 12.0 / f64::from(n)).sqrt());
                assert!((square - 1.0 / 3.0).abs() < 5.0 * (4.0 / 45.0 / f64::from(n)).sqrt());
            }
        }
        check::<Sobol>();
        check::<Independent>();
    }
}
