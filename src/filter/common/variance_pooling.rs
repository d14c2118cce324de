//! Shrinks the sample variance of pixels with few samples towards the variance of their 3×3 neighbourhood.
//!
//! With the neighbourhood's variance σ_pool², which counts as ν₀ = 2 samples, and a pixel's sample variance s²
//! of n samples: σ̃² = (ν₀ σ_pool² + (n − 1) s²) ∕ (ν₀ + n − 1).
//!
//! σ_pool² is the mean variance of the neighbours with at least two samples. Where there are none, [`pool`] and
//! [`pool_planes`] estimate it from the differences of means.

use rayon::prelude::*;

use crate::image::Planes;

/// ν₀.
const PRIOR_SAMPLES: f32 = 2.0;

/// Returns σ̃². `freedom` is n − 1, at least 0.
#[inline(always)]
pub fn shrink(pooled: f32, variance: f32, freedom: f32) -> f32 {
    (PRIOR_SAMPLES * pooled + freedom * variance) / (PRIOR_SAMPLES + freedom)
}

/// Writes the pooled variances of one dimension. `means` and `variances` are the sample means and unbiased sample
/// variances of the pixels, `counts` their numbers of samples, `width` the width of the image.
///
/// Where no neighbour has two samples, σ_pool² is half the mean squared difference between the pixel and its
/// neighbours with one sample.
pub fn pool(out: &mut [f32], means: &[f32], variances: &[f32], counts: &[u32], width: usize) {
    let height = means.len() / width.max(1);
    for (i, out) in out.iter_mut().enumerate() {
        let (x, y) = (i % width, i / width);
        let (mut known, mut sum) = (0.0, 0.0);
        let (mut pairs, mut squares) = (0.0, 0.0);
        for yj in y.saturating_sub(1)..=(y + 1).min(height - 1) {
            for xj in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                let j = yj * width + xj;
                if counts[j] >= 2 {
                    known += 1.0;
                    sum += variances[j];
                } else if counts[j] == 1 && j != i {
                    pairs += 1.0;
                    squares += (means[j] - means[i]).powi(2) / 2.0;
                }
            }
        }
        let pooled = if known > 0.0 {
            sum / known
        } else if pairs > 0.0 && counts[i] > 0 {
            squares / pairs
        } else {
            0.0
        };
        *out = shrink(pooled, variances[i], counts[i].saturating_sub(1) as f32);
    }
}

/// Pools the variances of three planes in place. `mean` are the means, `count` the numbers of samples.
///
/// Where no neighbour has two samples, σ_pool² is half the squared difference to the pixel on the left, which
/// estimates the variance of a mean, times the number of samples.
pub fn pool_planes(variance: &mut Planes, mean: &Planes, count: &[f32]) {
    let (width, height) = (variance.width(), variance.height());
    let known: Vec<f32> = count.iter().map(|&n| if n >= 2.0 { 1.0 } else { 0.0 }).collect();
    let weight = sum_3x3(width, height, &known);
    variance.planes_mut().enumerate().for_each(|(channel, plane)| {
        let sum = sum_3x3(width, height, plane);
        let from_difference = |i: usize| {
            let row = mean.row(channel, i / width);
            let x = i % width;
            0.5 * (row[x] - row[if x > 0 { x - 1 } else { 1.min(width - 1) }]).powi(2) * count[i]
        };
        plane.par_iter_mut().enumerate().with_min_len(width).for_each(|(i, v)| {
            let pooled = if weight[i] > 0.0 { sum[i] / weight[i] } else { from_difference(i) };
            *v = shrink(pooled, *v, (count[i] - 1.0).max(0.0));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variances_are_pooled_with_the_neighbours_by_their_samples() {
        let (width, height) = (7, 5);
        let number = |i: usize, by: usize| (i * by % 13) as f32;
        let means: Vec<f32> = (0..35).map(|i| number(i, 5)).collect();
        let counts: Vec<u32> =
            (0..35).map(|i| if i % 7 < 3 { [1, 0][i % 2] } else { [2, 5, 1][i % 3] }).collect();
        let variances: Vec<f32> =
            (0..35).map(|i| if counts[i] > 1 { 1.0 + number(i, 3) } else { 0.0 }).collect();
        let mut pooled = vec![0.0; 35];
        pool(&mut pooled, &means, &variances, &counts, width);
        for i in 0..35 {
            let near: Vec<usize> = (0..35)
                .filter(|j| (j % width).abs_diff(i % width) <= 1 && (j / width).abs_diff(i / width) <= 1)
                .collect();
            let mean = |values: Vec<f32>| values.iter().sum::<f32>() / values.len().max(1) as f32;
            let known: Vec<f32> = near.iter().filter(|&&j| counts[j] > 1).map(|&j| variances[j]).collect();
            let single = near.iter().filter(|&&j| j != i && counts[j] == 1);
            let pairs: Vec<f32> = single.map(|&j| (means[j] - means[i]).powi(2) / 2.0).collect();
            let pool = if !known.is_empty() {
                mean(known)
            } else if counts[i] > 0 {
                mean(pairs)
            } else {
                0.0
            };
            let own = counts[i].saturating_sub(1) as f32;
            let expected = (2.0 * pool + own * variances[i]) / (2.0 + own);
            assert!((pooled[i] - expected).abs() < 1e-4, "{i}: {} for {expected}", pooled[i]);
        }
        assert_eq!(height * width, 35);
    }
}
