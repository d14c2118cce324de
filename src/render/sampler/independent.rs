//! Independent uniform sample values: a random number generator (PCG) for every pixel, sample index and set of
//! dimensions.

use rand::RngExt;
use rand_pcg::Pcg32;

use super::sample_address::{SampleAddress, SampleAddresses};
use super::sampler::{SET_SIZE, Sampler, ValueSet};
use crate::hash::hash;
use crate::simd::{LANES, Lanes};

/// Samples one pixel with independent values.
#[derive(Clone, Copy)]
pub struct Independent {
    key: u64,
}

impl Sampler for Independent {
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self {
        Self { key: hash(hash(seed) ^ (u64::from(y) << 32 | u64::from(x))) }
    }

    #[inline]
    fn address(&self, index: u32) -> SampleAddress {
        SampleAddress { key: self.key, pixel: 0, index }
    }

    fn values(samples: &SampleAddresses, sets: &Lanes<u32>, values: &mut ValueSet) {
        for lane in 0..LANES {
            let SampleAddress { key, index, .. } = samples.at(lane);
            // State and stream are both hashed, because generators with related streams may be correlated.
            let state = hash(key ^ (u64::from(index) << 32 | u64::from(sets[lane])));
            let set: [f32; SET_SIZE as usize] = Pcg32::new(state, hash(state)).random();
            values.iter_mut().zip(set).for_each(|(lanes, value)| lanes[lane] = value);
        }
    }
}
