//! Estimates the variance, the residual, the risk and the error of a filtered image from the two halves of the samples.
//!
//! The risk is the squared error, without bias but far too noisy pixel by pixel. It needs no other samples than those of
//! the image. With the filtered halves F_h, their noisy values c_h, the fraction p_h of the samples in half h, and
//! D = c_A − c_B, whose square is on average the sum of the variances v_h of c_h, so that p_{1−h}D² is on average v_h:
//!
//! * [`ErrorMaps::cross_filtered`], for filters that take the weights of each half from the other. F_h is then linear in
//!   c_h, with the derivative a_h = ∂F_h/∂c_h, and Σ_h p_h [(F_h − c_h)² − (1 − 2a_h) p_{1−h}D²] − p_A p_B (F_A − F_B)² is
//!   the squared error of p_A F_A + p_B F_B (Stein's unbiased risk estimate for a linear filter; Bitterli et al. 2016,
//!   section 5, use the halves in the same way). D² in place of a pooled variance makes the terms of a pixel that keeps its
//!   own value, a_h = 1, cancel but for its variance.
//! * [`ErrorMaps::self_filtered`], for filters whose weights depend on all samples. Each filtered half is compared with
//!   the other half, which its values do not contain: Σ_h p_h [(F_h − c_{1−h})² − p_h D²] − p_A p_B (F_A − F_B)². That the
//!   weights contain it makes it too low.
//!
//! The error map is the larger of variance and risk, both averaged over the channels and blurred.

use rayon::prelude::*;

use super::blur;
use super::dual_buffer::DualBuffer;
use super::half_counts::HalfCounts;
use super::linear_estimate::LinearEstimate;
use crate::image::Planes;

/// Standard deviation of the blur of variance and risk in the error map, in pixels.
pub const ERROR_SIGMA: f32 = 4.0;

/// Maximum residual: where almost no noise is expected any difference is many times too large.
const MAX_RESIDUAL: f32 = 1e6;

/// Variance relative to the squared mean below which it is rounding.
const MIN_RELATIVE_VARIANCE: f32 = 1e-8;

/// Error maps of a filtered image.
pub struct ErrorMaps {
    /// ¼(F_A − F_B)², directly visible emission included: 3 planes.
    pub variance: Planes,
    /// Squared difference of the filtered from the noisy image over its expected value if the filter is
    /// unbiased: 1 plane.
    pub residual: Planes,
    /// Unbiased squared error, directly visible emission included: 3 planes. 0 where a half has no samples.
    pub risk: Planes,
    /// Squared error, mean of the channels: 1 plane.
    pub error: Planes,
}

/// A part of a cross-filtered image: the colour of surfaces, or directly visible emission.
#[derive(Clone, Copy)]
pub struct FilteredPart<'a> {
    pub noisy: &'a DualBuffer,
    pub filtered: &'a [LinearEstimate; 2],
}

/// A channel of a part: of both halves the noisy and the filtered values, and the filter derivatives.
struct PartChannel<'a> {
    noisy: [&'a [f32]; 2],
    filtered: [&'a [f32]; 2],
    derivative: [&'a [f32]; 2],
}

impl<'a> FilteredPart<'a> {
    fn channel(self, channel: usize) -> PartChannel<'a> {
        PartChannel {
            noisy: self.noisy.mean.each_ref().map(|mean| mean.plane(channel)),
            filtered: self.filtered.each_ref().map(|half| half.value.plane(channel)),
            derivative: self.filtered.each_ref().map(|half| half.derivative.as_slice()),
        }
    }
}

impl PartChannel<'_> {
    /// Returns the noisy and the filtered values and the derivatives of both halves at a pixel.
    fn at(&self, i: usize) -> [[f32; 2]; 3] {
        [self.noisy, self.filtered, self.derivative].map(|halves| halves.map(|half| half[i]))
    }
}

impl ErrorMaps {
    /// Estimates the error of a cross-filtered image, the sum of colour and emission. The residual is that of the colour.
    pub(in crate::filter) fn cross_filtered(
        colour: FilteredPart,
        emission: Option<FilteredPart>,
        counts: &HalfCounts,
    ) -> Self {
        let (width, height) = (colour.noisy.mean[0].width(), colour.noisy.mean[0].height());
        let [n_a, n_b] = counts.floats();
        let mut variance = Planes::new(width, height, 3);
        let mut risk = variance.clone();
        let mut residual = Planes::new(width, height, 1);
        for (channel, (variance, risk)) in variance.planes_mut().zip(risk.planes_mut()).enumerate() {
            let [v_a, v_b] = colour.noisy.variance.each_ref().map(|half| half.plane(channel));
            let colour = colour.channel(channel);
            let emission = emission.map(|emission| emission.channel(channel));
            let maps = variance.par_iter_mut().zip(risk).zip(residual.data_mut());
            maps.enumerate().with_min_len(width).for_each(|(i, ((variance, risk), residual))| {
                let [c, f, a] = colour.at(i);
                let [c_emission, f_emission, a_emission] =
                    emission.as_ref().map_or([[0.0; 2]; 3], |emission| emission.at(i));

                // Compare the change by the filter with its expectation. 0/0 is a pixel without noise that
                // did not change
                let expected =
                    0.25 * (v_a[i] + v_b[i]) * (1.0 - a[0] - a[1]).max(0.0) + 0.25 * (f[0] - f[1]).powi(2);
                let squared_change = (0.5 * (f[0] + f[1] - c[0] - c[1])).powi(2);
                let ratio = if expected > 0.0 { squared_change / expected } else { 0.0 };
                *residual += ratio.min(MAX_RESIDUAL) / 3.0;

                // Estimate variance and risk of the sum
                let [d_colour, d_emission] = [c[0] - c[1], c_emission[0] - c_emission[1]];
                let difference = d_colour + d_emission;
                let f_difference = (f[0] + f_emission[0]) - (f[1] + f_emission[1]);
                *variance = 0.25 * f_difference.powi(2);
                let Some(p) = fractions(n_a[i], n_b[i]) else { return };
                let risk_of = |h: usize| {
                    let change = f[h] + f_emission[h] - c[h] - c_emission[h];
                    // Covariance of the filtered with the noisy value
                    let kept = a[h] * d_colour + a_emission[h] * d_emission;
                    p[h] * (change.powi(2) - p[1 - h] * difference * (difference - 2.0 * kept))
                };
                *risk = risk_of(0) + risk_of(1) - p[0] * p[1] * f_difference.powi(2);
            });
        }
        Self { error: error(&variance, &risk), variance, residual, risk }
    }

    /// Estimates the error of an image whose weights depend on all samples. `image` and `halves` are the
    /// filtered images, `mean` and `sample_variance` the unfiltered mean and variance of the samples and `noisy_halves` the
    /// mean of each half (3 planes each), `counts` the sample counts of the halves.
    ///
    /// With the filtered image F, the mean c and its variance v the residual is (F − c)² ∕ (v + variance).
    pub fn self_filtered(
        image: &Planes,
        halves: [&Planes; 2],
        mean: &Planes,
        sample_variance: &Planes,
        noisy_halves: [&Planes; 2],
        counts: [&[u32]; 2],
    ) -> Self {
        let (width, height) = (image.width(), image.height());
        let mut variance = Planes::new(width, height, 3);
        let mut risk = variance.clone();
        let mut residual = Planes::new(width, height, 1);
        for (channel, (variance, risk)) in variance.planes_mut().zip(risk.planes_mut()).enumerate() {
            let [image, mean, sample_variance] =
                [image, mean, sample_variance].map(|planes| planes.plane(channel));
            let (filtered, noisy) =
                (halves.map(|half| half.plane(channel)), noisy_halves.map(|half| half.plane(channel)));
            let maps = variance.par_iter_mut().zip(risk).zip(residual.data_mut());
            maps.enumerate().with_min_len(width).for_each(|(i, ((variance, risk), residual))| {
                let (f, c) = (filtered.map(|half| half[i]), noisy.map(|half| half[i]));
                let n = counts.map(|counts| counts[i] as f32);
                *variance = 0.25 * (f[0] - f[1]).powi(2);
                if let Some(p) = fractions(n[0], n[1]) {
                    let squared_difference = (c[0] - c[1]).powi(2);
                    let risk_of = |h: usize| p[h] * ((f[h] - c[1 - h]).powi(2) - p[h] * squared_difference);
                    *risk = risk_of(0) + risk_of(1) - 4.0 * p[0] * p[1] * *variance;
                }
                // With less than two samples the variance is unknown, and the residual that of an unbiased filter.
                let total = n[0] + n[1];
                if total < 2.0 {
                    *residual += 1.0 / 3.0;
                    return;
                }
                let squared_change = (image[i] - mean[i]).powi(2);
                let expected = sample_variance[i] / total
                    + *variance
                    + MIN_RELATIVE_VARIANCE * mean[i] * mean[i]
                    + f32::MIN_POSITIVE;
                *residual += (squared_change / expected).min(MAX_RESIDUAL) / 3.0;
            });
        }
        Self { error: error(&variance, &risk), variance, residual, risk }
    }
}

/// Returns the fraction of a pixel's samples that each half has; `None` where one has none.
pub fn fractions(n_a: f32, n_b: f32) -> Option<[f32; 2]> {
    (n_a > 0.0 && n_b > 0.0).then(|| [n_a / (n_a + n_b), n_b / (n_a + n_b)])
}

/// Returns the map of the error: 1 plane.
fn error(variance: &Planes, risk: &Planes) -> Planes {
    let (width, height) = (variance.width(), variance.height());
    let blurred_mean = |planes: &Planes| {
        let plane: Vec<f32> = (0..planes.pixels()).into_par_iter().map(|i| planes.channel_mean(i)).collect();
        blur::gaussian(width, height, &plane, ERROR_SIGMA)
    };
    let [variance, risk] = [variance, risk].map(blurred_mean);
    let mut error = Planes::new(width, height, 1);
    let values = error.data_mut().iter_mut().zip(variance.iter().zip(&risk));
    values.for_each(|(error, (variance, risk))| *error = variance.max(*risk));
    error
}

#[cfg(test)]
mod tests;
