//! The best mixture of two estimates of one image.
//!
//! Both are linear in the values of the half that they filter, so that the risk of a mixture
//! λF₁ + (1−λ)F₂ is known without a reference (Stein's unbiased estimate, exact here) and quadratic
//! in λ: Σ (F−c)² − v + 2va, with c the noisy values, v their variance and a their own weight. Its
//! minimum is N/Q,
//!
//! N = −Σ [(F₁−F₂)(F₂−c) + v(a₁−a₂)] ρ, Q = Σ (F₁−F₂)² ρ, ρ = 1/(F² + 0.01 F̄²),
//!
//! over halves, channels and, by a blur, the surroundings. Estimates that differ by no more than
//! their noise, P = Σ v(a₁+a₂) ρ, decide nothing: λ = (N + ½P) / (Q + P).

use rayon::prelude::*;

use super::blur;
use super::halves::{Estimate, Halves};
use crate::image::Planes;

/// Keeps the relative error of dark pixels from counting more than it is seen; in units of the
/// squared mean of the image.
const RELATIVE_FLOOR: f32 = 0.01;
/// Below this share of the image's mean the first estimate is black, and stays so: it knows by
/// the normals what is no surface.
const BLACK: f32 = 1e-5;

/// What an error is relative to.
pub(super) struct Brightness {
    /// ρ: 3 planes.
    weight: Planes,
    /// What is below is black.
    black: f32,
}

impl Brightness {
    /// `image` is an estimate of the whole image, the sum and mean of `parts`: 3 planes each.
    pub fn of<'a>(image: &Planes, parts: impl IntoIterator<Item = &'a Planes>) -> Self {
        /// Of what the parts hold, an image is taken to be at least this bright: light that is less than none, which
        /// no renderer makes, may leave nothing of it.
        const LEAST_LEVEL: f64 = 1e-6;
        let level =
            parts.into_iter().map(|part| LEAST_LEVEL * magnitude(part)).fold(magnitude(image), f64::max);
        let level = (level as f32).max(f32::MIN_POSITIVE.sqrt());
        // Nothing is fainter than what has an inverse, or its weight would be infinite.
        let floor = (RELATIVE_FLOOR * level * level).max(f32::MIN_POSITIVE);
        let mut weight = image.clone();
        weight.data_mut().par_iter_mut().with_min_len(1024).for_each(|v| *v = 1.0 / (*v * *v + floor));
        Self { weight, black: BLACK * level }
    }
}

/// Mean of all planes' values without their signs.
fn magnitude(planes: &Planes) -> f64 {
    let values = planes.data();
    values.iter().map(|&v| f64::from(v.abs())).sum::<f64>() / values.len().max(1) as f64
}

/// Mixes two estimates of `noisy`; where they hardly differ, half and half. `sigma` is the blur of
/// the risk in pixels.
pub(super) fn mix(
    noisy: &Halves,
    brightness: &Brightness,
    mut first: [Estimate; 2],
    second: &[Estimate; 2],
    sigma: f32,
) -> [Estimate; 2] {
    let (width, height, pixels) = (noisy.mean[0].width(), noisy.mean[0].height(), noisy.mean[0].pixels());
    let mut sums = [(); 3].map(|()| vec![0.0; pixels]);
    for (h, (first, second)) in first.iter().zip(second).enumerate() {
        for c in 0..3 {
            let (f1, f2) = (first.value.plane(c), second.value.plane(c));
            let (mean, variance) = (noisy.mean[h].plane(c), noisy.variance[h].plane(c));
            let weight = brightness.weight.plane(c);
            let [n, q, p] = &mut sums;
            let sums = n.par_iter_mut().zip(q).zip(p).enumerate().with_min_len(1024);
            sums.for_each(|(i, ((n, q), p))| {
                let d = f1[i] - f2[i];
                let (own_1, own_2) = (first.own_weight[i], second.own_weight[i]);
                *n -= weight[i] * (d * (f2[i] - mean[i]) + variance[i] * (own_1 - own_2));
                *q += weight[i] * d * d;
                *p += weight[i] * variance[i] * (own_1 + own_2);
            });
        }
    }
    let [n, q, p] = sums.map(|plane| blur::gaussian(width, height, &plane, sigma));
    let is_black =
        |i: usize| first.iter().all(|half| (0..3).all(|c| half.value.plane(c)[i] < brightness.black));
    let best = |i| {
        let both = q[i] + p[i];
        if is_black(i) {
            1.0
        } else if both > 0.0 {
            ((n[i] + 0.5 * p[i]) / both).clamp(0.0, 1.0)
        } else {
            0.5
        }
    };
    let share: Vec<f32> = (0..pixels).into_par_iter().map(best).collect();
    let mixed = |first: &mut [f32], second: &[f32]| {
        let values = first.iter_mut().zip(second).zip(&share);
        values.for_each(|((f1, &f2), &share)| *f1 = f2 + share * (*f1 - f2));
    };
    for (first, second) in first.iter_mut().zip(second) {
        for c in 0..3 {
            mixed(first.value.plane_mut(c), second.value.plane(c));
        }
        mixed(&mut first.own_weight, &second.own_weight);
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes(value: f32) -> Planes {
        let mut planes = Planes::new(32, 32, 3);
        planes.data_mut().fill(value);
        planes
    }

    fn estimates(value: f32) -> [Estimate; 2] {
        [0, 1].map(|_| Estimate { value: planes(value), own_weight: vec![0.0; 1024] })
    }

    #[test]
    fn the_better_of_two_estimates_gets_the_larger_share() {
        let noisy = Halves { mean: [planes(0.4), planes(0.6)], variance: [planes(0.01), planes(0.01)] };
        let brightness = Brightness::of(&planes(0.5), []);
        let mixed = |a, b| mix(&noisy, &brightness, estimates(a), &estimates(b), 5.0)[0].value.at(0, 16, 16);
        // The truth is 0.5, and no weight on the own value says that the estimates have no noise.
        assert!((mixed(0.5, 0.9) - 0.5).abs() < 1e-3);
        assert!((mixed(0.9, 0.5) - 0.5).abs() < 1e-3);
        assert!((mixed(0.4, 0.6) - 0.5).abs() < 1e-3);
    }

    #[test]
    fn what_the_first_estimate_knows_to_be_black_stays_black() {
        let noisy = Halves { mean: [planes(0.4), planes(0.6)], variance: [planes(0.01), planes(0.01)] };
        let mixed = mix(&noisy, &Brightness::of(&planes(0.5), []), estimates(0.0), &estimates(0.5), 5.0);
        assert!(mixed.iter().all(|half| half.value.data().iter().all(|&v| v == 0.0)));
    }

    #[test]
    fn the_share_is_the_one_of_least_risk_between_the_noise_of_both() {
        let noisy = Halves { mean: [planes(0.4), planes(0.6)], variance: [planes(0.02), planes(0.03)] };
        let mut image = planes(0.5);
        image.plane_mut(2).fill(0.2);
        let brightness = Brightness::of(&image, []);
        let estimates = |values: [f32; 2], own: f32| {
            values.map(|value| Estimate { value: planes(value), own_weight: vec![own; 1024] })
        };
        let (first, second) = ([0.46, 0.52], [0.58, 0.5]);
        let (own_1, own_2) = (0.5, 0.2);
        let (mut n, mut q, mut p) = (0.0, 0.0, 0.0);
        for h in 0..2 {
            let (c, v) = ([0.4, 0.6][h], [0.02, 0.03][h]);
            for level in [0.5_f32, 0.5, 0.2] {
                let weight = 1.0 / (level * level + 0.01 * 0.4 * 0.4);
                let d: f32 = first[h] - second[h];
                n -= weight * (d * (second[h] - c) + v * (own_1 - own_2));
                q += weight * d * d;
                p += weight * v * (own_1 + own_2);
            }
        }
        let share = (n + p / 2.0) / (q + p);
        assert!(share > 0.05 && share < 0.95, "{share} tells little");
        let mixed = mix(&noisy, &brightness, estimates(first, own_1), &estimates(second, own_2), 5.0);
        for (h, half) in mixed.iter().enumerate() {
            let expected = second[h] + share * (first[h] - second[h]);
            assert!(half.value.data().iter().all(|v| (v - expected).abs() < 1e-4), "{h}: {expected}");
            let own = own_2 + share * (own_1 - own_2);
            assert!(half.own_weight.iter().all(|v| (v - own).abs() < 1e-4), "{h}: {own}");
        }
        // Nothing differs and nothing is noisy: half and half.
        let still = Halves { mean: [planes(0.5), planes(0.5)], variance: [planes(0.0), planes(0.0)] };
        let [a, _] = mix(&still, &brightness, estimates([0.5; 2], 1.0), &estimates([0.5; 2], 0.0), 5.0);
        assert!(a.own_weight.iter().all(|&v| v == 0.5));
    }
}
