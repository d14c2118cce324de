//! Addresses of samples: all that their values depend on, besides the dimension.

use crate::hash::hash;
use crate::simd::{LANES, Lanes};

/// Address of one sample.
#[derive(Clone, Copy)]
pub struct SampleAddress {
    pub key: u64,
    pub index: u32,
}

/// One [`SampleAddress`] a lane.
#[derive(Clone, Copy)]
pub struct SampleAddresses {
    pub keys: Lanes<u64>,
    pub indices: Lanes<u32>,
}

impl SampleAddresses {
    pub const NONE: Self = Self { keys: [0; LANES], indices: [0; LANES] };

    /// Returns one sample's address in every lane.
    pub const fn splat(SampleAddress { key, index }: SampleAddress) -> Self {
        Self { keys: [key; LANES], indices: [index; LANES] }
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, SampleAddress { key, index }: SampleAddress) {
        (self.keys[lane], self.indices[lane]) = (key, index);
    }

    #[inline(always)]
    pub fn at(&self, lane: usize) -> SampleAddress {
        SampleAddress { key: self.keys[lane], index: self.indices[lane] }
    }
}

/// Returns the key of a pixel's samples.
#[inline]
pub fn pixel_key(seed: u64, x: u32, y: u32) -> u64 {
    hash(hash(seed) ^ (u64::from(y) << 32 | u64::from(x)))
}
