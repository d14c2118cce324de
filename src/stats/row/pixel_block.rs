//! Adds one sample to each of sixteen neighbouring pixels at once, one pixel in each lane.

use crate::simd::{LANES, apply, multiversioned, prefetch};
use crate::stats::moments;

/// Largest magnitude of a valid sample's values. Filters compute variances and sums of squares as
/// `f32`, which holds squares up to 10³⁸; values in an image are far smaller.
pub const LARGEST_VALUE: f32 = 1e15;

/// Number of neighbouring pixels of a row that are updated together.
pub const PIXEL_BLOCK: usize = LANES;

/// One sample vector for each pixel of a block: `[dimension][pixel]`.
pub type PixelBlockValues = [[f32; PIXEL_BLOCK]];

/// Number of `f64` values in a cache line.
pub const CACHE_LINE: usize = 8;

/// The mask of the pixels whose values are finite, at most [`LARGEST_VALUE`], and not negative in the
/// dimensions `radiance`.
pub fn valid_lanes(values: &PixelBlockValues, radiance: &[usize]) -> u32 {
    let non_negative = || radiance.iter().all(|&dim| least(&values[dim]) >= 0.0);
    if largest(values.as_flattened()) <= LARGEST_VALUE && non_negative() {
        return u32::MAX;
    }
    let is_valid = |lane: usize| {
        values.iter().all(|lanes| lanes[lane].abs() <= LARGEST_VALUE)
            && radiance.iter().all(|&dim| values[dim][lane] >= 0.0)
    };
    (0..PIXEL_BLOCK).fold(0, |mask, lane| mask | u32::from(is_valid(lane)) << lane)
}

/// The largest magnitude; NaN counts as larger than any number.
#[apply(multiversioned!)]
fn largest(values: &[f32]) -> f32 {
    // Magnitudes are ordered as their bits are.
    f32::from_bits(values.iter().fold(0, |largest, value| largest.max(value.abs().to_bits())))
}

/// The smallest value, or 0 if none is negative.
#[inline]
fn least(lanes: &[f32; PIXEL_BLOCK]) -> f32 {
    lanes.iter().fold(0.0, |least, &value| if value < least { value } else { least })
}

/// Performs a Welford step in every dimension. `means` and `m2s` start at the block's first pixel;
/// `stride` is the offset from one dimension to the next. A pixel's weight is 1/n, where n counts the
/// new sample, or 0 if it has no sample.
#[apply(multiversioned!)]
pub fn update(
    means: &mut [f64],
    m2s: &mut [f32],
    stride: usize,
    values: &PixelBlockValues,
    weights: &[f64; PIXEL_BLOCK],
) {
    let blocks = means.chunks_mut(stride).zip(m2s.chunks_mut(stride));
    for ((means, m2s), values) in blocks.zip(values) {
        // Dimensions lie pages apart, so the hardware prefetcher does not predict the next block.
        for line in (PIXEL_BLOCK..2 * PIXEL_BLOCK).step_by(CACHE_LINE) {
            prefetch(means, line);
        }
        prefetch(m2s, PIXEL_BLOCK);
        let means: &mut [f64; PIXEL_BLOCK] =
            means.first_chunk_mut().expect("rows are padded to whole blocks");
        let m2s: &mut [f32; PIXEL_BLOCK] = m2s.first_chunk_mut().expect("rows are padded to whole blocks");
        for lane in 0..PIXEL_BLOCK {
            let (mean, weight) = (means[lane], weights[lane]);
            // A pixel without a sample makes a step of length 0, even if its lane holds NaN.
            let value = if weight > 0.0 { f64::from(values[lane]) } else { mean };
            let mut m2 = f64::from(m2s[lane]);
            moments::update(&mut means[lane], &mut m2, value, weight);
            m2s[lane] = moments::round_deviations(m2, means[lane]);
        }
    }
}
