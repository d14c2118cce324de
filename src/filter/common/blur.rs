//! Gaussian blur of a plane, for estimates that are too noisy pixel by pixel.

use rayon::prelude::*;

use crate::simd::{apply, multiversioned};

/// Returns a plane of `width`×`height` values, blurred with a Gaussian of standard deviation `sigma` pixels that is
/// cut off at three of them. Weights inside the image are normalised to 1 at its border, so that a constant plane
/// does not change.
pub fn gaussian(width: usize, height: usize, plane: &[f32], sigma: f32) -> Vec<f32> {
    if width == 0 || height == 0 || sigma <= 0.0 {
        return plane.to_vec();
    }
    let kernel = Kernel::new(sigma);
    let (norm_x, norm_y) = (kernel.norms(width), kernel.norms(height));

    // Blur the columns
    let mut vertical = vec![0.0; plane.len()];
    vertical.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (tap, weight) in kernel.taps() {
            let Some(y) = y.checked_add_signed(tap).filter(|&y| y < height) else { continue };
            let row = &plane[y * width..][..width];
            add_scaled(out, row, weight);
        }
        out.iter_mut().for_each(|v| *v *= norm_y[y]);
    });

    // Blur the rows
    let mut blurred = vec![0.0; plane.len()];
    blurred.par_chunks_mut(width).zip(vertical.par_chunks(width)).for_each(|(out, row)| {
        for (tap, weight) in kernel.taps() {
            let shift = tap.unsigned_abs().min(width);
            let inside = width - shift;
            let (out, row) = if tap < 0 {
                (&mut out[shift..], &row[..inside])
            } else {
                (&mut out[..inside], &row[shift..])
            };
            add_scaled(out, row, weight);
        }
        out.iter_mut().zip(&norm_x).for_each(|(v, norm)| *v *= norm);
    });
    blurred
}

#[apply(multiversioned!)]
fn add_scaled(sum: &mut [f32], values: &[f32], factor: f32) {
    sum.iter_mut().zip(values).for_each(|(sum, &v)| *sum += factor * v);
}

/// The weights along one axis.
struct Kernel {
    radius: isize,
    weights: Vec<f32>,
}

impl Kernel {
    fn new(sigma: f32) -> Self {
        let radius = (3.0 * sigma).ceil() as isize;
        let weight = |tap: isize| (-0.5 * (tap as f32 / sigma).powi(2)).exp();
        Self { radius, weights: (-radius..=radius).map(weight).collect() }
    }

    fn taps(&self) -> impl Iterator<Item = (isize, f32)> {
        (-self.radius..=self.radius).zip(self.weights.iter().copied())
    }

    /// Returns the inverse sum of the weights inside the image, for each position along an axis.
    fn norms(&self, length: usize) -> Vec<f32> {
        let inside = |at: usize, tap: isize| at.checked_add_signed(tap).is_some_and(|i| i < length);
        (0..length)
            .map(|at| 1.0 / self.taps().filter(|&(tap, _)| inside(at, tap)).map(|(_, w)| w).sum::<f32>())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_planes_do_not_change() {
        for (w, h) in [(1, 1), (1, 9), (5, 2), (40, 30)] {
            let blurred = gaussian(w, h, &vec![3.0; w * h], 4.0);
            assert!(blurred.iter().all(|v| (v - 3.0).abs() < 1e-5), "{w}x{h}");
        }
        for (w, h) in [(0, 0), (0, 3), (3, 0)] {
            assert!(gaussian(w, h, &[], 4.0).is_empty());
        }
    }

    #[test]
    fn an_impulse_becomes_a_gaussian() {
        let mut plane = vec![0.0; 41 * 41];
        plane[20 * 41 + 20] = 1.0;
        let blurred = gaussian(41, 41, &plane, 3.0);
        let at = |x: usize, y: usize| blurred[y * 41 + x];
        let expected = |r2: f32| (-r2 / 18.0).exp() / (2.0 * std::f32::consts::PI * 9.0);
        for (x, y) in [(20, 20), (23, 20), (20, 16), (24, 23)] {
            let r2 = (x as f32 - 20.0).powi(2) + (y as f32 - 20.0).powi(2);
            assert!((at(x, y) / expected(r2) - 1.0).abs() < 0.02, "{x},{y}");
        }
    }
}
