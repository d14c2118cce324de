//! Corrects the variance of the mean s²∕n by the difference of the two halves of the samples (after
//! Rousselle, Knaus and Zwicker 2012, section 5.1).
//!
//! Samples of low discrepancy make means more accurate than s²∕n. The halves are independent, so that their
//! mean squared difference estimates the sum of the true variances of both means.

use rayon::prelude::*;

use super::blur;
use super::half_counts::HalfCounts;
use crate::image::Planes;

/// Standard deviation of the blur of both estimates, in pixels.
pub const SIGMA: f32 = 3.0;

/// Range of the correction.
const RANGE: (f32, f32) = (0.02, 2.0);

/// Returns the factor for each pixel's variances: the blurred squared difference of the halves' means over
/// their blurred variances, both summed over three channels. `variance` are the variances s²∕n of the means.
pub fn variance_correction(mean: &[Planes; 2], variance: &[Planes; 2], counts: &HalfCounts) -> Vec<f32> {
    let measured = blurred_sum(mean, counts, |a, b| (a - b) * (a - b));
    let expected = blurred_sum(variance, counts, |a, b| a + b);
    let (low, high) = RANGE;
    let factor = |(&m, &e): (&f32, &f32)| if e > 0.0 { (m / e).clamp(low, high) } else { 1.0 };
    measured.iter().zip(&expected).map(factor).collect()
}

/// Sums a function of the halves over three channels where both halves have samples, and blurs the sums.
fn blurred_sum([a, b]: &[Planes; 2], counts: &HalfCounts, of: impl Fn(f32, f32) -> f32 + Sync) -> Vec<f32> {
    let (width, height) = (a.width(), a.height());
    let mut sums = vec![0.0; width * height];
    sums.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, sums)| {
        for channel in 0..3 {
            let halves = a.row(channel, y).iter().zip(b.row(channel, y));
            sums.iter_mut().zip(halves).for_each(|(sum, (&a, &b))| *sum += of(a, b));
        }
        let [n_a, n_b] = counts.floats().map(|counts| &counts[y * width..][..width]);
        for (sum, (&n_a, &n_b)) in sums.iter_mut().zip(n_a.iter().zip(n_b)) {
            *sum = if n_a > 0.0 && n_b > 0.0 { *sum } else { 0.0 };
        }
    });
    blur::gaussian(width, height, &sums, SIGMA)
}
