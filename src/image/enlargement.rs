//! Enlarges a coarse image, which has a pixel for every square of pixels of the full one.

use rayon::prelude::*;

use super::Planes;

/// Returns an image of `size` pixels: the uniform cubic B-spline with the values of the squares of `side` pixels at their
/// middles. It has no kinks and damps what alternates from square to square, such as the grid that the dilated kernels of
/// `learned` leave, to a third.
pub fn smoothed(image: &Planes, side: usize, size: (usize, usize)) -> Planes {
    let weights: Vec<[f32; SQUARES]> = (0..side).map(|at| spline_weights(at, side)).collect();
    let sum = |weights: &[f32; SQUARES], values: &[f32]| -> f32 {
        weights.iter().zip(values).map(|(weight, value)| weight * value).sum()
    };
    let mut planes = Planes::new(size.0, size.1, image.count());
    for (plane, out) in planes.planes_mut().enumerate() {
        out.par_chunks_mut(size.0.max(1)).enumerate().for_each(|(y, row)| {
            // Sum over lines
            let index = |k: usize| (y / side + k).saturating_sub(SQUARES / 2).min(image.height() - 1);
            let lines: [&[f32]; SQUARES] = std::array::from_fn(|k| image.row(plane, index(k)));
            let at = |x: usize| sum(&weights[y % side], &lines.map(|line| line[x]));
            let mut line: Vec<f32> = (0..image.width()).map(at).collect();

            // Continue the line at its ends, and sum over columns
            let [first, last] = [line[0], line[image.width() - 1]];
            line.splice(..0, [first; SQUARES / 2]);
            line.extend([last; SQUARES / 2]);
            for (values, squares) in row.chunks_mut(side).zip(line.windows(SQUARES)) {
                values.iter_mut().zip(&weights).for_each(|(value, weights)| *value = sum(weights, squares));
            }
        });
    }
    planes
}

/// Squares along one axis that the values of a square's pixels follow from: its own, and two on each side.
const SQUARES: usize = 5;

/// Returns the weights of these squares for the pixel `at` of the middle one. Of the first and the last, the more distant one has none.
fn spline_weights(at: usize, side: usize) -> [f32; SQUARES] {
    let position = (at as f32 + 0.5) / side as f32 - 0.5;
    let first = if position < 0.0 { 0 } else { 1 };
    let u = position.rem_euclid(1.0);
    let (u2, u3) = (u * u, u * u * u);
    let mut weights = [0.0; SQUARES];
    weights[first..first + 4].copy_from_slice(
        &[(1.0 - u).powi(3), 3.0 * u3 - 6.0 * u2 + 4.0, 3.0 * (u + u2 - u3) + 1.0, u3]
            .map(|weight| weight / 6.0),
    );
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_reproduces_ramps_and_damps_what_alternates() {
        let (squares, side) = (16, 4);
        let image_of = |value: fn(usize) -> f32| {
            let mut image = Planes::new(squares, squares, 1);
            image.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = value(i % squares));
            smoothed(&image, side, (squares * side - 1, squares * side - 1))
        };
        let inner = 2 * side..(squares - 2) * side;
        let ramp = image_of(|x| x as f32);
        for x in inner.clone() {
            let expected = (x as f32 + 0.5) / side as f32 - 0.5;
            assert!((ramp.at(0, x, 30) - expected).abs() < 1e-5, "{x}");
        }
        let alternating = image_of(|x| if x % 2 == 0 { 1.0 } else { -1.0 });
        let largest = inner.map(|x| alternating.at(0, x, 0).abs()).fold(0.0, f32::max);
        assert!(largest <= 1.0 / 3.0, "{largest}");
    }
}
