//! The interface of samplers.

use super::sample_address::{SampleAddress, SampleAddresses};
use crate::simd::Lanes;

/// Dimensions that a sampler generates together, and may stratify together.
pub const SET_SIZE: u32 = 4;

/// Sample values of one set of dimensions, a sample a lane.
pub type ValueSet = [Lanes; SET_SIZE as usize];

/// Generates the sample values of all samples of one pixel.
pub trait Sampler: Copy {
    /// Returns the sampler of the pixel at (`x`, `y`) of the whole image.
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self;

    /// Returns all that the values of the pixel's `index`-th sample depend on, besides the dimension.
    fn address(&self, index: u32) -> SampleAddress;

    /// Generates the dimensions `4 set` to `4 set + 3` of each lane's sample, in [0, 1).
    fn values(samples: &SampleAddresses, sets: &Lanes<u32>, values: &mut ValueSet);
}
