//! Enlarges a coarse image, which has a pixel for every square of pixels of the full one.

use rayon::prelude::*;

use super::Planes;

/// Returns an image of `size` pixels in which every square of `side` pixels has the value of its pixel of `image`.
#[cfg(any(test, feature = "app"))]
pub fn enlarged(image: &Planes, side: usize, size: (usize, usize)) -> Planes {
    by_rows(size, image.count(), |plane, y, row| {
        let squares = image.row(plane, y / side);
        row.iter_mut().enumerate().for_each(|(x, value)| *value = squares[x / side]);
    })
}

/// Returns an image of `size` pixels: the uniform cubic B-spline with the values of the squares of `side` pixels at their
/// middles. It has no kinks and damps what alternates from square to square, such as the grid that the dilated kernels of
/// `learned` leave, to a third.
pub fn smoothed(image: &Planes, side: usize, size: (usize, usize)) -> Planes {
    by_rows(size, image.count(), |plane, y, row| {
        let (lines, weights) = spline_weights(y, side, image.height());
        let lines = lines.map(|line| image.row(plane, line));
        let sum_over_lines = |x: usize| lines.iter().zip(weights).map(|(line, w)| w * line[x]).sum::<f32>();
        let line: Vec<f32> = (0..image.width()).map(sum_over_lines).collect();
        for (x, value) in row.iter_mut().enumerate() {
            let (columns, weights) = spline_weights(x, side, image.width());
            *value = columns.iter().zip(weights).map(|(&column, w)| w * line[column]).sum();
        }
    })
}

/// Makes an image row by row: `fill` gets the plane, the row's index and the row.
fn by_rows(
    (width, height): (usize, usize),
    count: usize,
    fill: impl Fn(usize, usize, &mut [f32]) + Sync,
) -> Planes {
    let mut planes = Planes::new(width, height, count);
    for (plane, out) in planes.planes_mut().enumerate() {
        out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| fill(plane, y, row));
    }
    planes
}

/// Returns the four squares around a pixel along one axis, and their weights.
fn spline_weights(at: usize, side: usize, squares: usize) -> ([usize; 4], [f32; 4]) {
    let position = (at as f32 + 0.5) / side as f32 - 0.5;
    let first = position.floor();
    let u = position - first;
    let indices = [0, 1, 2, 3].map(|k| (first as isize - 1 + k).clamp(0, squares as isize - 1) as usize);
    let (u2, u3) = (u * u, u * u * u);
    let weights = [(1.0 - u).powi(3), 3.0 * u3 - 6.0 * u2 + 4.0, 3.0 * (u + u2 - u3) + 1.0, u3];
    (indices, weights.map(|weight| weight / 6.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_have_one_value() {
        let mut image = Planes::new(2, 1, 1);
        image.data_mut().copy_from_slice(&[1.0, 5.0]);
        // The last square is cut off.
        assert_eq!(enlarged(&image, 4, (6, 2)).data()[..6], [1.0, 1.0, 1.0, 1.0, 5.0, 5.0]);
    }

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
