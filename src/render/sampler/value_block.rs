//! Generation of consecutive dimensions that may start in the middle of a set.

use super::sample_address::SampleAddresses;
use super::sampler::{SET_SIZE, Sampler};
use crate::simd::{LANES, Lanes};

/// Sets that a block overlaps at most: that of a bounce has eight dimensions, and may start in the middle of
/// a set.
const MAX_SETS: usize = 3;

/// Sample values of consecutive dimensions, a sample a lane.
type ValueBlock = [Lanes; MAX_SETS * SET_SIZE as usize];

/// Generates the `size` dimensions of each lane's sample from its `starts` on. These are even: pairs are
/// stratified together, and never straddle two sets.
pub fn value_block<S: Sampler>(samples: &SampleAddresses, starts: &Lanes<u32>, size: u32) -> ValueBlock {
    let mut sets = [0; LANES];
    let mut offsets = [0; LANES];
    let mut offset_bits = 0;
    for lane in 0..LANES {
        sets[lane] = starts[lane] / SET_SIZE;
        offsets[lane] = starts[lane] % SET_SIZE;
        offset_bits |= offsets[lane];
    }
    let mut values: ValueBlock = [[0.0; LANES]; MAX_SETS * SET_SIZE as usize];
    let (value_sets, _) = values.as_chunks_mut();
    for set in value_sets.iter_mut().take((size + offset_bits).div_ceil(SET_SIZE) as usize) {
        S::values(samples, &sets, set);
        sets.iter_mut().for_each(|set| *set += 1);
    }
    if offset_bits > 0 {
        for d in 0..size as usize {
            for lane in 0..LANES {
                let shifted = values[d + 2][lane];
                values[d][lane] = if offsets[lane] == 0 { values[d][lane] } else { shifted };
            }
        }
    }
    values
}

/// Returns the dimensions `dimension` and `dimension + 1` of a block.
#[inline]
pub fn value_pair(values: &ValueBlock, dimension: u32) -> [Lanes; 2] {
    [values[dimension as usize], values[dimension as usize + 1]]
}
