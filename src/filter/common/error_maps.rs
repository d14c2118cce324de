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

use std::ops::Range;

use rayon::prelude::*;

use super::blur;
use super::dual_buffer::DualBuffer;
use super::half_counts::HalfCounts;
use super::linear_estimate::LinearEstimate;
use crate::image::Planes;
use crate::simd::{apply, multiversioned};

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

/// A channel of a part, of some pixels: of both halves the noisy and the filtered values, and the filter derivatives.
struct PartChannel<'a> {
    noisy: [&'a [f32]; 2],
    filtered: [&'a [f32]; 2],
    derivative: [&'a [f32]; 2],
}

impl<'a> FilteredPart<'a> {
    /// Returns a channel of some pixels.
    fn channel(self, channel: usize, pixels: Range<usize>) -> PartChannel<'a> {
        PartChannel {
            noisy: self.noisy.mean.each_ref().map(|mean| &mean.plane(channel)[pixels.clone()]),
            filtered: self.filtered.each_ref().map(|half| &half.value.plane(channel)[pixels.clone()]),
            derivative: self.filtered.each_ref().map(|half| &half.derivative[pixels.clone()]),
        }
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
        let mut variance = Planes::new(width, height, 3);
        let mut risk = variance.clone();
        let mut residual = Planes::new(width, height, 1);
        let black = vec![0.0; width];
        let no_emission = PartChannel { noisy: [&black; 2], filtered: [&black; 2], derivative: [&black; 2] };
        for (channel, (variance, risk)) in variance.planes_mut().zip(risk.planes_mut()).enumerate() {
            for_each_row(width, [variance, risk, residual.data_mut()], |row, [variance, risk, residual]| {
                let noisy_variance =
                    colour.noisy.variance.each_ref().map(|half| &half.plane(channel)[row.clone()]);
                let counts = counts.floats().map(|counts| &counts[row.clone()]);
                let colour = colour.channel(channel, row.clone());
                add_cross_residual(&colour, noisy_variance, residual);
                match emission {
                    Some(emission) => {
                        cross_risk(&colour, &emission.channel(channel, row), counts, variance, risk)
                    }
                    None => cross_risk(&colour, &no_emission, counts, variance, risk),
                }
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
            for_each_row(width, [variance, risk, residual.data_mut()], |row, [variance, risk, residual]| {
                let [image, mean, sample_variance] =
                    [image, mean, sample_variance].map(|planes| &planes.plane(channel)[row.clone()]);
                let [filtered, noisy] =
                    [halves, noisy_halves].map(|halves| halves.map(|half| &half.plane(channel)[row.clone()]));
                let counts = counts.map(|counts| &counts[row.clone()]);
                self_risk(filtered, noisy, counts, variance, risk);
                add_self_residual([image, mean, sample_variance], variance, counts, residual);
            });
        }
        Self { error: error(&variance, &risk), variance, residual, risk }
    }
}

/// Calls a function with each row's pixels and the rows of three planes, in parallel.
fn for_each_row(
    width: usize,
    [a, b, c]: [&mut [f32]; 3],
    each: impl Fn(Range<usize>, [&mut [f32]; 3]) + Sync,
) {
    let [a, b, c] = [a, b, c].map(|plane| plane.par_chunks_mut(width.max(1)));
    a.zip(b).zip(c).enumerate().for_each(|(y, ((a, b), c))| each(y * width..(y + 1) * width, [a, b, c]));
}

/// Adds a third of the residual of a channel. `variance`: those of the noisy values of both halves.
#[apply(multiversioned!)]
fn add_cross_residual(colour: &PartChannel, variance: [&[f32]; 2], residual: &mut [f32]) {
    let n = residual.len();
    let PartChannel { noisy: [c_a, c_b], filtered: [f_a, f_b], derivative: [a_a, a_b] } = colour;
    let (c_a, c_b, f_a, f_b) = (&c_a[..n], &c_b[..n], &f_a[..n], &f_b[..n]);
    let ([v_a, v_b], a_a, a_b) = (variance, &a_a[..n], &a_b[..n]);
    let (v_a, v_b) = (&v_a[..n], &v_b[..n]);
    for i in 0..n {
        // Compare the change by the filter with its expectation. 0/0 is a pixel without noise that did not change
        let expected =
            0.25 * (v_a[i] + v_b[i]) * (1.0 - a_a[i] - a_b[i]).max(0.0) + 0.25 * (f_a[i] - f_b[i]).powi(2);
        let squared_change = (0.5 * (f_a[i] + f_b[i] - c_a[i] - c_b[i])).powi(2);
        let ratio = if expected > 0.0 { squared_change / expected } else { 0.0 };
        residual[i] += ratio.min(MAX_RESIDUAL) / 3.0;
    }
}

/// Writes variance and risk of the sum of colour and emission, of a channel.
#[apply(multiversioned!)]
fn cross_risk(
    colour: &PartChannel,
    emission: &PartChannel,
    counts: [&[f32]; 2],
    variance: &mut [f32],
    risk: &mut [f32],
) {
    let n = variance.len();
    let risk = &mut risk[..n];
    // Of the colour c, noisy, f, filtered, and a, derivatives; of the emission likewise e, g and b. With equal lengths the compiler
    // removes all bounds checks.
    let ([c_a, c_b], [f_a, f_b], [a_a, a_b]) = (colour.noisy, colour.filtered, colour.derivative);
    let ([e_a, e_b], [g_a, g_b], [b_a, b_b]) = (emission.noisy, emission.filtered, emission.derivative);
    let [n_a, n_b] = counts;
    let (n_a, n_b, c_a, c_b) = (&n_a[..n], &n_b[..n], &c_a[..n], &c_b[..n]);
    let (f_a, f_b, a_a, a_b) = (&f_a[..n], &f_b[..n], &a_a[..n], &a_b[..n]);
    let (e_a, e_b, g_a, g_b, b_a, b_b) = (&e_a[..n], &e_b[..n], &g_a[..n], &g_b[..n], &b_a[..n], &b_b[..n]);
    for i in 0..n {
        let (d_colour, d_emission) = (c_a[i] - c_b[i], e_a[i] - e_b[i]);
        let difference = d_colour + d_emission;
        let f_difference = (f_a[i] + g_a[i]) - (f_b[i] + g_b[i]);
        variance[i] = 0.25 * f_difference.powi(2);
        let p = fractions(n_a[i], n_b[i]).unwrap_or([0.0; 2]);
        // The change, and the covariance of the filtered with the noisy value
        let half = |p: f32, p_other: f32, change: f32, kept: f32| {
            p * (change.powi(2) - p_other * difference * (difference - 2.0 * kept))
        };
        let [kept_a, kept_b] =
            [a_a[i] * d_colour + b_a[i] * d_emission, a_b[i] * d_colour + b_b[i] * d_emission];
        let of_a = half(p[0], p[1], f_a[i] + g_a[i] - c_a[i] - e_a[i], kept_a);
        let of_b = half(p[1], p[0], f_b[i] + g_b[i] - c_b[i] - e_b[i], kept_b);
        risk[i] = of_a + of_b - p[0] * p[1] * f_difference.powi(2);
    }
}

/// Writes variance and risk of a channel whose weights depend on all samples. `filtered` and `noisy` are those of the halves.
#[apply(multiversioned!)]
fn self_risk(
    filtered: [&[f32]; 2],
    noisy: [&[f32]; 2],
    counts: [&[u32]; 2],
    variance: &mut [f32],
    risk: &mut [f32],
) {
    let n = variance.len();
    let risk = &mut risk[..n];
    let ([f_a, f_b], [c_a, c_b], [n_a, n_b]) = (filtered, noisy, counts);
    let (f_a, f_b, c_a, c_b) = (&f_a[..n], &f_b[..n], &c_a[..n], &c_b[..n]);
    let (n_a, n_b) = (&n_a[..n], &n_b[..n]);
    for i in 0..n {
        variance[i] = 0.25 * (f_a[i] - f_b[i]).powi(2);
        let p = fractions(n_a[i] as f32, n_b[i] as f32).unwrap_or([0.0; 2]);
        let squared_difference = (c_a[i] - c_b[i]).powi(2);
        let half = |p: f32, change: f32| p * (change.powi(2) - p * squared_difference);
        let of_halves = half(p[0], f_a[i] - c_b[i]) + half(p[1], f_b[i] - c_a[i]);
        risk[i] = of_halves - 4.0 * p[0] * p[1] * variance[i];
    }
}

/// Adds a third of the residual of a channel whose weights depend on all samples. `images` are the filtered one, the unfiltered one and the
/// variance of its samples.
#[apply(multiversioned!)]
fn add_self_residual(images: [&[f32]; 3], variance: &[f32], counts: [&[u32]; 2], residual: &mut [f32]) {
    let n = residual.len();
    let ([image, mean, sample_variance], [n_a, n_b]) = (images, counts);
    let (image, mean, sample_variance) = (&image[..n], &mean[..n], &sample_variance[..n]);
    let (n_a, n_b, variance) = (&n_a[..n], &n_b[..n], &variance[..n]);
    for i in 0..n {
        let total = n_a[i] as f32 + n_b[i] as f32;
        let squared_change = (image[i] - mean[i]).powi(2);
        let expected = sample_variance[i] / total
            + variance[i]
            + MIN_RELATIVE_VARIANCE * mean[i] * mean[i]
            + f32::MIN_POSITIVE;
        let ratio = (squared_change / expected).min(MAX_RESIDUAL);
        // With less than two samples the variance is unknown, and the residual that of an unbiased filter.
        let of_channel = if total < 2.0 { 1.0 } else { ratio };
        residual[i] += of_channel / 3.0;
    }
}

/// Returns the fraction of a pixel's samples that each half has; `None` where one has none.
#[inline(always)]
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
