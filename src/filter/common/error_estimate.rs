//! Estimates the variance, the bias and the error of a filtered image from the two halves of the samples.
//!
//! There are two estimates. [`ErrorEstimate::cross_filtered`] is for filters that take the weights of each
//! half from the other: the filtered half F_h is then linear in its own noisy values c_h and, with a_h =
//! ∂F_h/∂c_h and the variance v_h of c_h, R = ½Σ_h[(F_h − c_h)² − v_h + 2v_h a_h] − ¼(F_A − F_B)² is an
//! unbiased estimate of the squared error of ½(F_A + F_B) (Stein's unbiased risk estimate for a linear
//! filter; Bitterli et al. 2016, section 5, use the halves in the same way). [`ErrorEstimate::self_filtered`]
//! is for filters whose weights depend on all samples, which have no such derivative.
//!
//! Pixel by pixel both are far too noisy to use; blurred they are maps.

use rayon::prelude::*;

use super::blur;
use super::dual_buffer::DualBuffer;
use crate::image::Planes;

/// Standard deviation of the blur of the estimated bias, in pixels.
const BIAS_SIGMA: f32 = 4.0;

/// Maximum residual: where almost no noise is expected any difference is many times too large.
const MAX_RESIDUAL: f32 = 1e6;

/// Variance relative to the squared mean below which it is rounding.
const MIN_RELATIVE_VARIANCE: f32 = 1e-8;

/// Error maps of a filtered image.
pub struct ErrorEstimate {
    /// ¼(F_A − F_B)², directly visible emission included: 3 planes.
    pub variance: Planes,
    /// Squared difference of the filtered from the noisy image over its expected value if the filter is
    /// unbiased: 1 plane.
    pub residual: Planes,
    /// Squared error, mean of the channels: 1 plane.
    pub error: Planes,
}

impl ErrorEstimate {
    /// Estimates the error of a cross-filtered image. `noisy` is the input of the filter and `filtered` its
    /// result for each half; `emission` is added to the result, 3 planes for each half. `derivative` is a_h
    /// of each pixel.
    pub fn cross_filtered(
        noisy: &DualBuffer,
        filtered: &[Planes; 2],
        emission: Option<&[Planes; 2]>,
        derivative: [&[f32]; 2],
    ) -> Self {
        let (width, height) = (filtered[0].width(), filtered[0].height());
        let mean_derivative = |i: usize| 0.5 * (derivative[0][i] + derivative[1][i]);
        let mut variance = Planes::new(width, height, 3);
        let mut residual = Planes::new(width, height, 1);
        let mut bias = vec![0.0; width * height];
        let mut mean_variance = vec![0.0; width * height];
        for (channel, variance) in variance.planes_mut().enumerate() {
            let [c_a, c_b] = [0, 1].map(|h| noisy.mean[h].plane(channel));
            let [f_a, f_b] = [0, 1].map(|h| filtered[h].plane(channel));
            let [v_a, v_b] = [0, 1].map(|h| noisy.variance[h].plane(channel));
            let maps =
                variance.par_iter_mut().zip(residual.data_mut()).zip(&mut bias).zip(&mut mean_variance);
            let maps = maps.enumerate().with_min_len(width);
            maps.for_each(|(i, (((variance, residual), bias), mean_variance))| {
                // Estimate the squared bias as the risk without the variance
                let filtered_variance = 0.25 * (f_a[i] - f_b[i]).powi(2);
                let risk = |f: f32, c: f32, v: f32, a: f32| (f - c).powi(2) - v + 2.0 * v * a;
                let risk_a = risk(f_a[i], c_a[i], v_a[i], derivative[0][i]);
                let risk_b = risk(f_b[i], c_b[i], v_b[i], derivative[1][i]);
                *bias += (0.5 * (risk_a + risk_b) - 2.0 * filtered_variance) / 3.0;

                // Compute the variance with emission
                let emitted = emission.map_or(0.0, |[a, b]| a.plane(channel)[i] - b.plane(channel)[i]);
                *variance = 0.25 * (f_a[i] - f_b[i] + emitted).powi(2);
                *mean_variance += *variance / 3.0;

                // Compare the change by the filter with its expectation. 0/0 is a pixel without noise that
                // did not change
                let expected =
                    0.25 * (v_a[i] + v_b[i]) * (1.0 - 2.0 * mean_derivative(i)).max(0.0) + filtered_variance;
                let change = (0.5 * (f_a[i] + f_b[i] - c_a[i] - c_b[i])).powi(2);
                let ratio = if expected > 0.0 { change / expected } else { 0.0 };
                *residual += ratio.min(MAX_RESIDUAL) / 3.0;
            });
        }

        // Add the blurred bias where it is positive
        let [bias, mean_variance] =
            [bias, mean_variance].map(|plane| blur::gaussian(width, height, &plane, BIAS_SIGMA));
        let mut error = Planes::new(width, height, 1);
        for (error, (bias, variance)) in error.plane_mut(0).iter_mut().zip(bias.iter().zip(&mean_variance)) {
            *error = variance + bias.max(0.0);
        }
        Self { variance, residual, error }
    }

    /// Estimates the error of an image whose weights depend on all samples. `image` and `halves` are the
    /// filtered images, `mean` and `sample_variance` the unfiltered mean and variance of the samples (3
    /// planes each), `counts` the sample counts of the halves.
    ///
    /// With the filtered image F, the mean c and its variance v the residual is (F − c)² ∕ (v + variance),
    /// and the error is the variance plus the blurred squared bias (F − c)² − v where that is positive.
    pub fn self_filtered(
        image: &Planes,
        halves: [&Planes; 2],
        mean: &Planes,
        sample_variance: &Planes,
        counts: [&[u32]; 2],
    ) -> Self {
        let (width, height, pixels) = (image.width(), image.height(), image.pixels());
        let [a, b] = halves;
        let mut variance = Planes::new(width, height, 3);
        let mut residual = Planes::new(width, height, 1);
        let mut bias = vec![0.0; pixels];
        let mut error = Planes::new(width, height, 1);
        for i in 0..3 * pixels {
            let pixel = i % pixels;
            let n = (counts[0][pixel] + counts[1][pixel]) as f32;
            let v = 0.25 * (a.data()[i] - b.data()[i]).powi(2);
            variance.data_mut()[i] = v;
            error.data_mut()[pixel] += v / 3.0;
            // With less than two samples the variance is unknown, and the residual that of an unbiased filter.
            if n < 2.0 {
                residual.data_mut()[pixel] += 1.0 / 3.0;
                continue;
            }
            let noise = sample_variance.data()[i] / n;
            let mean = mean.data()[i];
            let squared = (image.data()[i] - mean).powi(2);
            let expected = noise + v + MIN_RELATIVE_VARIANCE * mean * mean + f32::MIN_POSITIVE;
            residual.data_mut()[pixel] += (squared / expected).min(MAX_RESIDUAL) / 3.0;
            bias[pixel] += (squared - noise) / 3.0;
        }
        let bias = blur::gaussian(width, height, &bias, BIAS_SIGMA);
        for (error, bias) in error.data_mut().iter_mut().zip(&bias) {
            *error += bias.max(0.0);
        }
        Self { variance, residual, error }
    }
}

#[cfg(test)]
mod tests;
