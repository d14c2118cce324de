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
    let mut vertical = vec![0.0; plane.len()];
    vertical.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        kernel.taps().for_each(|tap| add_row(out, plane, y, tap));
        out.iter_mut().for_each(|v| *v *= norm_y[y]);
    });
    let mut blurred = vec![0.0; plane.len()];
    blurred.par_chunks_mut(width).zip(vertical.par_chunks(width)).for_each(|(out, row)| {
        kernel.taps().for_each(|tap| add_shifted(out, row, tap));
        out.iter_mut().zip(&norm_x).for_each(|(v, norm)| *v *= norm);
    });
    blurred
}

/// Returns the distance in pixels from which values contribute to a blurred one.
pub fn reach(sigma: f32) -> usize {
    (3.0 * sigma).ceil() as usize
}

/// Returns the variance of a blurred value relative to the blurred variance, 1/(4πσ²), for independent values.
pub fn variance_factor(sigma: f32) -> f32 {
    1.0 / (4.0 * std::f32::consts::PI * sigma * sigma)
}

/// Does the same as [`gaussian`], with a weight of 0 for the pixel itself: the result at a pixel does not depend on its
/// own value, however large.
pub fn gaussian_of_others(width: usize, height: usize, plane: &[f32], sigma: f32) -> Vec<f32> {
    if width * height <= 1 || sigma <= 0.0 {
        return plane.to_vec();
    }
    let kernel = Kernel::new(sigma);
    let (norm_x, norm_y) = (kernel.norms(width), kernel.norms(height));
    let is_other = |&(tap, _): &(isize, f32)| tap != 0;
    // The sums over columns, and those without the pixel, whose weight is 1
    let mut others = vec![0.0; plane.len()];
    let mut vertical = vec![0.0; plane.len()];
    others.par_chunks_mut(width).zip(vertical.par_chunks_mut(width)).enumerate().for_each(
        |(y, (others, all))| {
            kernel.taps().filter(is_other).for_each(|tap| add_row(others, plane, y, tap));
            all.copy_from_slice(others);
            add_row(all, plane, y, (0, 1.0));
        },
    );
    others.par_chunks_mut(width).zip(vertical.par_chunks(width)).enumerate().for_each(|(y, (out, row))| {
        kernel.taps().filter(is_other).for_each(|tap| add_shifted(out, row, tap));
        out.iter_mut().zip(&norm_x).for_each(|(v, norm_x)| *v /= 1.0 / (norm_x * norm_y[y]) - 1.0);
    });
    others
}

/// Adds the row of a plane that lies `tap` below row `y`, if there is one.
fn add_row(sum: &mut [f32], plane: &[f32], y: usize, (tap, weight): (isize, f32)) {
    let width = sum.len();
    if let Some(y) = y.checked_add_signed(tap).filter(|&y| y < plane.len() / width) {
        add_scaled(sum, &plane[y * width..][..width], weight);
    }
}

/// Adds the values of a row that lie `tap` to the right, where there are some.
fn add_shifted(sum: &mut [f32], row: &[f32], (tap, weight): (isize, f32)) {
    let shift = tap.unsigned_abs().min(row.len());
    let inside = row.len() - shift;
    let (sum, row) =
        if tap < 0 { (&mut sum[shift..], &row[..inside]) } else { (&mut sum[..inside], &row[shift..]) };
    add_scaled(sum, row, weight);
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
        let radius = reach(sigma) as isize;
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
    fn without_the_pixel_itself_its_value_does_not_matter() {
        for (w, h) in [(1, 9), (5, 2), (17, 12)] {
            let mut plane: Vec<f32> = (0..w * h).map(|i| (i * 37 % 101) as f32).collect();
            let blurred = gaussian_of_others(w, h, &plane, 1.5);
            for (i, &found) in blurred.iter().enumerate() {
                let (mut sum, mut total) = (0.0, 0.0);
                for j in (0..w * h).filter(|&j| j != i) {
                    let (dx, dy) = ((j % w).abs_diff(i % w), (j / w).abs_diff(i / w));
                    if dx.max(dy) <= 5 {
                        let weight = (-((dx * dx + dy * dy) as f32) / (2.0 * 1.5 * 1.5)).exp();
                        (sum, total) = (sum + weight * plane[j], total + weight);
                    }
                }
                assert!((found - sum / total).abs() < 1e-3 * found, "{w}x{h} {i}: {found}");
            }
            plane[0] = 1e30;
            assert_eq!(gaussian_of_others(w, h, &plane, 1.5)[0], blurred[0]);
        }
        assert_eq!(gaussian_of_others(1, 1, &[3.0], 4.0), [3.0]);
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
