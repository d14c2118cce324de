//! Blends two estimates of an image by their estimated risk.
//!
//! Takes two estimates of each half of the samples that are linear in its values, and returns λF₁ + (1−λ)F₂.
//! Without a reference the risk Σ (F − c)² − v + 2va of the blend is known up to a constant (Stein's unbiased
//! estimate, exact for linear filters), with c the noisy values, v their variance and a the filter derivative
//! at the pixel. It is quadratic in λ with its minimum at N/Q,
//!
//! N = −Σ [(F₁−F₂)(F₂−c) + v(a₁−a₂)] ρ, Q = Σ (F₁−F₂)² ρ, ρ = 1/(F² + 0.01 F̄²),
//!
//! where the sums extend over halves, channels and, by a blur, surrounding pixels. Where estimates differ by
//! less than their noise P = Σ v(a₁+a₂) ρ, the blend tends to the mean of both: λ = (N + ½P) / (Q + P).

use rayon::prelude::*;

use crate::filter::common::TASK_PIXELS;
use crate::filter::common::blur;
use crate::filter::common::dual_buffer::DualBuffer;
use crate::filter::common::linear_estimate::LinearEstimate;
use crate::filter::whole_image::{self, WholeImage};
use crate::image::Planes;

/// Floor of the squared brightness in relative errors, in units of the squared mean of the image.
const RELATIVE_FLOOR: f32 = 0.01;

/// Value, relative to the image's mean, below which the first estimate is black. It stays black: the normals
/// have shown that there is no surface.
const BLACK: f32 = 1e-5;

/// The brightness that errors are relative to.
pub struct Brightness {
    /// ρ: 3 planes.
    weight: Planes,
    /// Values below are black.
    black: f32,
}

impl Brightness {
    /// `image` is an estimate of the whole image and the sum of `parts`: 3 planes each.
    pub fn new<'a>(
        image: &Planes,
        parts: impl IntoIterator<Item = &'a Planes>,
        whole: &dyn WholeImage,
    ) -> Self {
        /// Minimum brightness relative to the parts. Parts with negative radiance, which renderers do not
        /// produce, may cancel in the image.
        const MIN_LEVEL: f64 = 1e-6;
        let mean_magnitude = |planes| whole_image::mean(whole, planes, f32::abs);
        let level = parts
            .into_iter()
            .map(|part| MIN_LEVEL * mean_magnitude(part))
            .fold(mean_magnitude(image), f64::max);
        let level = (level as f32).max(f32::MIN_POSITIVE.sqrt());
        // The floor keeps the weight finite.
        let floor = (RELATIVE_FLOOR * level * level).max(f32::MIN_POSITIVE);
        let mut weight = image.clone();
        weight.data_mut().par_iter_mut().with_min_len(TASK_PIXELS).for_each(|v| *v = 1.0 / (*v * *v + floor));
        Self { weight, black: BLACK * level }
    }
}

/// Blends two estimates of `noisy`. `sigma` is the standard deviation of the blur of the risk, in pixels.
pub fn blend(
    noisy: &DualBuffer,
    brightness: &Brightness,
    first: [LinearEstimate; 2],
    second: &[LinearEstimate; 2],
    sigma: f32,
) -> [LinearEstimate; 2] {
    let fraction = fraction_of_first(noisy, brightness, &first, second, sigma);
    mix(first, second, &fraction)
}

/// Blends two estimates by the fraction of the first in each pixel.
pub fn mix(
    mut first: [LinearEstimate; 2],
    second: &[LinearEstimate; 2],
    fraction: &[f32],
) -> [LinearEstimate; 2] {
    let blend_values = |first: &mut [f32], second: &[f32]| {
        let values = first.iter_mut().zip(second).zip(fraction);
        values.for_each(|((f1, &f2), &fraction)| *f1 = f2 + fraction * (*f1 - f2));
    };
    for (first, second) in first.iter_mut().zip(second) {
        for c in 0..3 {
            blend_values(first.value.plane_mut(c), second.value.plane(c));
        }
        blend_values(&mut first.derivative, &second.derivative);
    }
    first
}

/// Computes λ for each pixel: the fraction of the first estimate.
pub fn fraction_of_first(
    noisy: &DualBuffer,
    brightness: &Brightness,
    first: &[LinearEstimate; 2],
    second: &[LinearEstimate; 2],
    sigma: f32,
) -> Vec<f32> {
    // Sum N, Q and P over halves and channels
    let (width, height, pixels) = (noisy.mean[0].width(), noisy.mean[0].height(), noisy.mean[0].pixels());
    let mut sums = [(); 3].map(|()| vec![0.0; pixels]);
    for (h, (first, second)) in first.iter().zip(second).enumerate() {
        for c in 0..3 {
            let (f1, f2) = (first.value.plane(c), second.value.plane(c));
            let (mean, variance) = (noisy.mean[h].plane(c), noisy.variance[h].plane(c));
            let weight = brightness.weight.plane(c);
            let [n, q, p] = &mut sums;
            let sums = n.par_iter_mut().zip(q).zip(p).enumerate().with_min_len(TASK_PIXELS);
            sums.for_each(|(i, ((n, q), p))| {
                let d = f1[i] - f2[i];
                let (a1, a2) = (first.derivative[i], second.derivative[i]);
                *n -= weight[i] * (d * (f2[i] - mean[i]) + variance[i] * (a1 - a2));
                *q += weight[i] * d * d;
                *p += weight[i] * variance[i] * (a1 + a2);
            });
        }
    }
    let [n, q, p] = sums.map(|plane| blur::gaussian(width, height, &plane, sigma));

    // Minimise the risk
    let is_black =
        |i: usize| first.iter().all(|half| (0..3).all(|c| half.value.plane(c)[i] < brightness.black));
    let minimum = |i| {
        let denominator = q[i] + p[i];
        if is_black(i) {
            1.0
        } else if denominator > 0.0 {
            ((n[i] + 0.5 * p[i]) / denominator).clamp(0.0, 1.0)
        } else {
            0.5
        }
    };
    (0..pixels).into_par_iter().map(minimum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::whole_image::AllPixels;

    fn planes(value: f32) -> Planes {
        let mut planes = Planes::new(32, 32, 3);
        planes.data_mut().fill(value);
        planes
    }

    fn estimates(value: f32) -> [LinearEstimate; 2] {
        [0, 1].map(|_| LinearEstimate { value: planes(value), derivative: vec![0.0; 1024] })
    }

    #[test]
    fn the_better_of_two_estimates_gets_the_larger_fraction() {
        let noisy = DualBuffer { mean: [planes(0.4), planes(0.6)], variance: [planes(0.01), planes(0.01)] };
        let brightness = Brightness::new(&planes(0.5), [], &AllPixels::new(32, 32));
        let blended =
            |a, b| blend(&noisy, &brightness, estimates(a), &estimates(b), 5.0)[0].value.at(0, 16, 16);
        // The truth is 0.5, and derivatives of 0 say that the estimates have no noise.
        assert!((blended(0.5, 0.9) - 0.5).abs() < 1e-3);
        assert!((blended(0.9, 0.5) - 0.5).abs() < 1e-3);
        assert!((blended(0.4, 0.6) - 0.5).abs() < 1e-3);
    }

    #[test]
    fn pixels_that_are_black_in_the_first_estimate_stay_black() {
        let noisy = DualBuffer { mean: [planes(0.4), planes(0.6)], variance: [planes(0.01), planes(0.01)] };
        let blended = blend(
            &noisy,
            &Brightness::new(&planes(0.5), [], &AllPixels::new(32, 32)),
            estimates(0.0),
            &estimates(0.5),
            5.0,
        );
        assert!(blended.iter().all(|half| half.value.data().iter().all(|&v| v == 0.0)));
    }

    #[test]
    fn the_fraction_minimises_the_risk() {
        let noisy = DualBuffer { mean: [planes(0.4), planes(0.6)], variance: [planes(0.02), planes(0.03)] };
        let mut image = planes(0.5);
        image.plane_mut(2).fill(0.2);
        let brightness = Brightness::new(&image, [], &AllPixels::new(32, 32));
        let estimates = |values: [f32; 2], own: f32| {
            values.map(|value| LinearEstimate { value: planes(value), derivative: vec![own; 1024] })
        };
        // Evaluate the formula
        let (first, second) = ([0.46, 0.52], [0.58, 0.5]);
        let (a1, a2) = (0.5, 0.2);
        let (mut n, mut q, mut p) = (0.0, 0.0, 0.0);
        for h in 0..2 {
            let (c, v) = ([0.4, 0.6][h], [0.02, 0.03][h]);
            for level in [0.5_f32, 0.5, 0.2] {
                let weight = 1.0 / (level * level + 0.01 * 0.4 * 0.4);
                let d: f32 = first[h] - second[h];
                n -= weight * (d * (second[h] - c) + v * (a1 - a2));
                q += weight * d * d;
                p += weight * v * (a1 + a2);
            }
        }
        let fraction = (n + p / 2.0) / (q + p);
        assert!(fraction > 0.05 && fraction < 0.95, "{fraction} is at an end of the range");
        // Compare with the blend
        let blended = blend(&noisy, &brightness, estimates(first, a1), &estimates(second, a2), 5.0);
        for (h, half) in blended.iter().enumerate() {
            let expected = second[h] + fraction * (first[h] - second[h]);
            assert!(half.value.data().iter().all(|v| (v - expected).abs() < 1e-4), "{h}: {expected}");
            let own = a2 + fraction * (a1 - a2);
            assert!(half.derivative.iter().all(|v| (v - own).abs() < 1e-4), "{h}: {own}");
        }
        // Equal estimates without noise are averaged.
        let noise_free =
            DualBuffer { mean: [planes(0.5), planes(0.5)], variance: [planes(0.0), planes(0.0)] };
        let [a, _] =
            blend(&noise_free, &brightness, estimates([0.5; 2], 1.0), &estimates([0.5; 2], 0.0), 5.0);
        assert!(a.derivative.iter().all(|&v| v == 0.5));
    }
}
