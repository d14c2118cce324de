//! Independent uniform numbers: a generator for every (pixel, sample index), a stream of it for
//! every set.

use rand::RngExt;
use rand_pcg::Pcg32;

use super::{Address, Addresses, NumberSet, SET, Source, hash, pixel_key};
use crate::geometry::{LANES, Lanes};

/// See the module.
#[derive(Clone, Copy)]
pub struct Independent {
    key: u64,
}

impl Source for Independent {
    fn for_pixel(seed: u64, x: u32, y: u32) -> Self {
        Self { key: pixel_key(seed, x, y) }
    }

    #[inline]
    fn address(&self, index: u32) -> Address {
        Address { key: self.key, index }
    }

    fn numbers(samples: &Addresses, sets: &Lanes<u32>, numbers: &mut NumberSet) {
        for lane in 0..LANES {
            let Address { key, index } = samples.at(lane);
            // Generators with related streams may be correlated: state and stream are both hashed.
            let state = hash(key ^ (u64::from(index) << 32 | u64::from(sets[lane])));
            let drawn: [f32; SET as usize] = Pcg32::new(state, hash(state)).random();
            numbers.iter_mut().zip(drawn).for_each(|(lanes, number)| lanes[lane] = number);
        }
    }
}
