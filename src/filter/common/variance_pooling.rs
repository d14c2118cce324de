//! Shrinks the sample variance of pixels with few samples towards the variance of their 3×3 neighbourhood.
//!
//! With the neighbourhood's variance σ_pool², which counts as ν₀ = 2 samples, and a pixel's sample variance s²
//! of n samples: σ̃² = (ν₀ σ_pool² + (n − 1) s²) ∕ (ν₀ + n − 1).
//!
//! σ_pool² is the mean variance of the neighbours with at least two samples. Where there are none, it is estimated from
//! the differences of means.

use rayon::prelude::*;

use crate::image::Planes;

/// ν₀.
const PRIOR_SAMPLES: f32 = 2.0;

/// Returns σ̃². `freedom` is n − 1, at least 0.
#[inline(always)]
pub fn shrink(pooled: f32, variance: f32, freedom: f32) -> f32 {
    (PRIOR_SAMPLES * pooled + freedom * variance) / (PRIOR_SAMPLES + freedom)
}

/// Pools the variances of all planes in place. `mean` are the means, `count` the numbers of samples.
///
/// Where no neighbour has two samples, σ_pool² is half the squared difference to the pixel on the left, which
/// estimates the variance of a mean, times the number of samples.
pub fn pool_planes(variance: &mut Planes, mean: &Planes, count: &[f32]) {
    let (width, height) = (variance.width(), variance.height());
    let known: Vec<f32> = count.iter().map(|&n| if n >= 2.0 { 1.0 } else { 0.0 }).collect();
    let weight = sum_3x3(width, height, &known);
    variance.planes_mut().enumerate().for_each(|(channel, plane)| {
        let sum = sum_3x3(width, height, plane);
        plane.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, out)| {
            let row = y * width..(y + 1) * width;
            let (mean, count) = (mean.row(channel, y), &count[row.clone()]);
            let others = std::iter::once(&mean[1.min(width - 1)]).chain(mean);
            let squared: Vec<f32> =
                mean.iter().zip(others).map(|(own, other)| (own - other) * (own - other)).collect();
            let known = sum[row.clone()].iter().zip(&weight[row]);
            for (((v, (sum, weight)), squared), n) in out.iter_mut().zip(known).zip(squared).zip(count) {
                let pooled = if *weight > 0.0 { sum / weight } else { 0.5 * squared * n };
                *v = shrink(pooled, *v, (n - 1.0).max(0.0));
            }
        });
    });
}

/// Sums over the 3×3 pixels around each pixel, as far as they lie in the image.
fn sum_3x3(width: usize, height: usize, plane: &[f32]) -> Vec<f32> {
    let mut sums = vec![0.0; plane.len()];
    if width == 0 {
        return sums;
    }
    sums.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let mut column = vec![0.0; width];
        for row in plane.chunks_exact(width).take((y + 2).min(height)).skip(y.saturating_sub(1)) {
            column.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
        }
        out.copy_from_slice(&column);
        out[1..].iter_mut().zip(&column).for_each(|(out, v)| *out += v);
        out.iter_mut().zip(&column[1..]).for_each(|(out, v)| *out += v);
    });
    sums
}
