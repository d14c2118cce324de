//! Computes the factors that scale the filtered image to the local brightness of the samples: filters that suppress bright samples darken it.
//!
//! Over a wide surrounding the mean of the unfiltered image c is known well. There the filtered image F is multiplied by
//! 1 + r, r = Σ(c − F) / ΣF, which has the variance Σv / (ΣF)² with the variance v of c. The prior of r is normal with mean
//! 0 and deviation [`USUAL_LOSS`], so an uncertain r shrinks towards 0. Pixels with an empty half, whose variance is
//! unknown, are left out.

use rayon::prelude::*;

use super::dual_image::DualImage;
use crate::filter::common::TASK_PIXELS;
use crate::filter::common::blur;
use crate::filter::common::half_counts::HalfCounts;

/// Standard deviation of the prior of r.
const USUAL_LOSS: f32 = 0.05;

/// Least r, which halves the brightness.
const LEAST_CHANGE: f32 = -0.5;

/// Standard deviation of the blur that the sums are, in pixels.
const SIGMA: f32 = 16.0;

/// Returns the distance in pixels from which pixels can change a factor.
pub fn reach() -> usize {
    blur::reach(SIGMA)
}

/// Returns the factors that give the pixels of the filtered image the brightness of the `noisy` one.
pub fn factors(filtered: &DualImage, noisy: &DualImage, counts: &HalfCounts) -> Vec<f32> {
    let (width, height, pixels) = (noisy.mean.width(), noisy.mean.height(), noisy.mean.pixels());
    let over_surrounding = |of: &(dyn Fn(usize) -> f32 + Sync)| {
        let sum = |i: usize| match counts.floats().iter().all(|counts| counts[i] > 0.0) {
            true => (0..3).map(|c| of(c * pixels + i)).sum(),
            false => 0.0,
        };
        let plane: Vec<f32> = (0..pixels).into_par_iter().with_min_len(TASK_PIXELS).map(sum).collect();
        blur::gaussian(width, height, &plane, SIGMA)
    };
    let (mean, noise, image) = (noisy.mean.data(), noisy.noise.data(), filtered.mean.data());
    let lost = over_surrounding(&|i| mean[i] - image[i]);
    let brightness = over_surrounding(&|i| image[i]);
    let variance = over_surrounding(&|i| noise[i] * noise[i]);

    let variance_factor = blur::variance_factor(SIGMA);
    let factor = |i: usize| {
        let loss = lost[i] / brightness[i];
        let uncertainty = variance_factor * variance[i] / (brightness[i] * brightness[i]);
        let change = loss / (1.0 + uncertainty / (USUAL_LOSS * USUAL_LOSS));
        if change.is_finite() { 1.0 + change.max(LEAST_CHANGE) } else { 1.0 }
    };
    (0..pixels).into_par_iter().with_min_len(TASK_PIXELS).map(factor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Planes;

    /// Returns the brightness in the middle after a loss of a tenth, if the noise has a deviation.
    fn restored(deviation: f32) -> f32 {
        let constant = |value: f32| {
            let mut planes = Planes::new(64, 64, 3);
            planes.data_mut().fill(value);
            planes
        };
        let counts = HalfCounts::new(64, [vec![2; 64 * 64], vec![2; 64 * 64]]);
        let mut filtered = DualImage::exact(constant(0.9));
        let noisy = DualImage { mean: constant(1.0), noise: constant(deviation) };
        filtered.scale(&factors(&filtered, &noisy, &counts));
        filtered.mean.at(1, 32, 32)
    }

    #[test]
    fn lost_light_comes_back_as_far_as_it_is_certain() {
        assert!((restored(0.0) - 1.0).abs() < 1e-5);
        assert!((restored(0.1) - 1.0).abs() < 1e-3);
        assert!(restored(30.0) < 0.91);
    }
}
