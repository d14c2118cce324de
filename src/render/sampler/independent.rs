//! Independent uniform numbers: a generator for every (pixel, sample index), a stream of it for
//! every set.

use rand::RngExt;
use rand_pcg::Pcg32;

use super::{SET, Source, hash, pixel_key};

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
    fn numbers(&self, index: u32, set: u32) -> [f32; SET as usize] {
        // Generators with related streams may be correlated: state and stream are both hashed.
        let state = hash(self.key ^ (u64::from(index) << 32 | u64::from(set)));
        Pcg32::new(state, hash(state)).random()
    }
}
