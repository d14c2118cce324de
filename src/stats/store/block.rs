//! A sample of each of sixteen neighbouring pixels at once, a lane for each: their moments lie side by side.

use multiversion::multiversion;

use super::{CACHE_LINE, LARGEST_VALUE};
use crate::geometry::prefetch;
use crate::stats::moments;

/// Neighbouring pixels of a row whose samples are taken in together.
pub const BLOCK: usize = 16;

/// Sample vectors of a block's pixels: a lane for each pixel, by dimension.
pub type BlockValues = [[f32; BLOCK]];

/// A bit for each pixel whose values are all finite, not too large, and not negative in the dimensions
/// `radiance`.
pub(super) fn sound(values: &BlockValues, radiance: &[usize]) -> u32 {
    let positive = || radiance.iter().all(|&dim| least(&values[dim]) >= 0.0);
    if largest(values.as_flattened()) <= LARGEST_VALUE && positive() {
        return u32::MAX;
    }
    let of_lane = |lane: usize| {
        values.iter().all(|lanes| lanes[lane].abs() <= LARGEST_VALUE)
            && radiance.iter().all(|&dim| values[dim][lane] >= 0.0)
    };
    (0..BLOCK).fold(0, |sound, lane| sound | u32::from(of_lane(lane)) << lane)
}

/// The largest magnitude, NaN being larger than all.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn largest(values: &[f32]) -> f32 {
    // Magnitudes are ordered as their bits are.
    f32::from_bits(values.iter().fold(0, |largest, value| largest.max(value.abs().to_bits())))
}

#[inline]
fn least(lanes: &[f32; BLOCK]) -> f32 {
    lanes.iter().fold(0.0, |least, &value| if value < least { value } else { least })
}

/// A Welford step of every dimension. `means` and `m2s` start at the block's first pixel, dimensions are
/// `stride` apart; a pixel's weight is 1/n with the new sample counted, or 0 if it has none.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
pub(super) fn update(
    means: &mut [f64],
    m2s: &mut [f64],
    stride: usize,
    values: &BlockValues,
    weights: &[f64; BLOCK],
) {
    let blocks = means.chunks_mut(stride).zip(m2s.chunks_mut(stride));
    for ((means, m2s), values) in blocks.zip(values) {
        // Dimensions lie pages apart, where no processor foresees that the next block comes next.
        for line in (BLOCK..2 * BLOCK).step_by(CACHE_LINE) {
            prefetch(means, line);
            prefetch(m2s, line);
        }
        let means: &mut [f64; BLOCK] = means.first_chunk_mut().expect("a row is of whole blocks");
        let m2s: &mut [f64; BLOCK] = m2s.first_chunk_mut().expect("a row is of whole blocks");
        for lane in 0..BLOCK {
            let (mean, weight) = (means[lane], weights[lane]);
            // A step of no length for a pixel without a sample, whatever its lane holds.
            let value = if weight > 0.0 { f64::from(values[lane]) } else { mean };
            moments::update(&mut means[lane], &mut m2s[lane], value, weight);
        }
    }
}
