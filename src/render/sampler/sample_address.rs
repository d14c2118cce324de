//! Addresses of samples: all that their values depend on, besides the dimension.

use crate::simd::{LANES, Lanes};

/// Address of one sample.
#[derive(Clone, Copy)]
pub struct SampleAddress {
    /// Of the seed, and of the half or the pixel.
    pub key: u64,
    /// The pixel's column and row, less than 2¹⁶ each, the row in the upper half; 0 where the key is the pixel's.
    pub pixel: u32,
    /// Index among the samples of the key: within a half for Sobol' points, within the pixel for independent ones.
    pub index: u32,
}

/// One [`SampleAddress`] a lane.
#[derive(Clone, Copy)]
pub struct SampleAddresses {
    pub keys: Lanes<u64>,
    pub pixels: Lanes<u32>,
    pub indices: Lanes<u32>,
}

impl SampleAddresses {
    pub const NONE: Self = Self { keys: [0; LANES], pixels: [0; LANES], indices: [0; LANES] };

    /// Returns one sample's address in every lane.
    pub const fn splat(SampleAddress { key, pixel, index }: SampleAddress) -> Self {
        Self { keys: [key; LANES], pixels: [pixel; LANES], indices: [index; LANES] }
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, SampleAddress { key, pixel, index }: SampleAddress) {
        (self.keys[lane], self.pixels[lane], self.indices[lane]) = (key, pixel, index);
    }

    #[inline(always)]
    pub fn at(&self, lane: usize) -> SampleAddress {
        SampleAddress { key: self.keys[lane], pixel: self.pixels[lane], index: self.indices[lane] }
    }
}
