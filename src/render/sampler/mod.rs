//! Where a sample's numbers come from. They are addressed, not drawn: a number depends on (seed,
//! pixel, sample index, dimension) alone, so an image depends neither on threads nor on batches.

mod dimensions;
mod independent;
mod sobol;

use glam::Vec2;

pub use dimensions::{BounceNumbers, Dimensions, Needs};
pub use independent::Independent;
pub use sobol::Sobol;

/// Dimensions are made four at a time.
const SET: u32 = 4;

/// The numbers of all samples of one pixel.
pub trait Source: Copy {
    /// The source of the pixel at (`x`, `y`) of the whole image.
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self;

    /// Four numbers in [0, 1): dimensions `4 set` to `4 set + 3` of a sample.
    fn numbers(&self, index: u32, set: u32) -> [f32; SET as usize];
}

/// The numbers of one sample.
pub struct Stream<S> {
    source: S,
    index: u32,
    /// The last set that was made, as neighbouring dimensions are asked for one after the other.
    set: u32,
    numbers: [f32; SET as usize],
}

impl<S: Source> Stream<S> {
    #[inline]
    pub fn new(source: S, index: u32) -> Self {
        Self { numbers: source.numbers(index, 0), source, index, set: 0 }
    }

    /// One number.
    #[inline]
    pub fn one(&mut self, dimension: u32) -> f32 {
        let set = dimension / SET;
        if set != self.set {
            self.set = set;
            self.numbers = self.source.numbers(self.index, set);
        }
        self.numbers[(dimension % SET) as usize]
    }

    /// Two numbers that are stratified together; `dimension` is even.
    #[inline]
    pub fn two(&mut self, dimension: u32) -> Vec2 {
        debug_assert!(dimension.is_multiple_of(2), "a pair must not straddle two sets");
        Vec2::new(self.one(dimension), self.one(dimension + 1))
    }
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
#[inline]
fn hash(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Key of a pixel's numbers.
#[inline]
fn pixel_key(seed: u64, x: u32, y: u32) -> u64 {
    hash(hash(seed) ^ (u64::from(y) << 32 | u64::from(x)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all<S: Source>(seed: u64, index: u32) -> Vec<f32> {
        let source = S::for_pixel(seed, 3, 5);
        let mut stream = Stream::new(source, index);
        (0..40).map(|d| stream.one(d)).collect()
    }

    #[test]
    fn the_same_address_gives_the_same_number_in_any_order() {
        let source = Sobol::for_pixel(1, 3, 5);
        let (mut forward, mut backward) = (Stream::new(source, 9), Stream::new(source, 9));
        let a: Vec<f32> = (0..40).map(|d| forward.one(d)).collect();
        let mut b: Vec<f32> = (0..40).rev().map(|d| backward.one(d)).collect();
        b.reverse();
        assert_eq!(a, b);
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
                let values: Vec<f64> =
                    (0..n).map(|i| f64::from(Stream::new(source, i).one(dimension))).collect();
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
