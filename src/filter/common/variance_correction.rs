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
    let (width, height) = (mean[0].width(), mean[0].height());
    let counts = counts.floats();
    let blurred_sum = |value: &(dyn Fn(usize, usize) -> f32 + Sync)| -> Vec<f32> {
        let has_both = |i: usize| counts[0][i] > 0.0 && counts[1][i] > 0.0;
        let sum = |i| if has_both(i) { value(0, i) + value(1, i) + value(2, i) } else { 0.0 };
        let plane: Vec<f32> = (0..width * height).into_par_iter().map(sum).collect();
        blur::gaussian(width, height, &plane, SIGMA)
    };
    let measured = blurred_sum(&|c, i| (mean[0].plane(c)[i] - mean[1].plane(c)[i]).powi(2));
    let expected = blurred_sum(&|c, i| variance[0].plane(c)[i] + variance[1].plane(c)[i]);
    let (low, high) = RANGE;
    let factor = |(&m, &e): (&f32, &f32)| if e > 0.0 { (m / e).clamp(low, high) } else { 1.0 };
    measured.iter().zip(&expected).map(factor).collect()
}
