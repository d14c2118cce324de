//! Enlarges a coarse image, which has a pixel for every square of pixels of the full one.

use rayon::prelude::*;

use crate::image::Planes;

/// Returns an image of `size` pixels in which every square of `side` pixels has the value of its pixel of `image`.
pub fn enlarged(image: &Planes, side: usize, size: (usize, usize)) -> Planes {
    by_rows(size, image.count(), |plane, y, row| {
        let squares = image.row(plane, y / side);
        row.iter_mut().enumerate().for_each(|(x, value)| *value = squares[x / side]);
    })
}

/// Returns an image of `size` pixels that interpolates linearly between the middles of the squares of `side` pixels.
pub fn interpolated(image: &Planes, side: usize, size: (usize, usize)) -> Planes {
    by_rows(size, image.count(), |plane, y, row| {
        let ([above, below], v) = neighbours(y, side, image.height());
        let (above, below) = (image.row(plane, above), image.row(plane, below));
        for (x, value) in row.iter_mut().enumerate() {
            let ([left, right], u) = neighbours(x, side, image.width());
            let mix = |row: &[f32]| row[left] + u * (row[right] - row[left]);
            *value = mix(above) + v * (mix(below) - mix(above));
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

/// Returns the squares on both sides of a pixel along one axis, and how far it is from the first to the second.
fn neighbours(at: usize, side: usize, squares: usize) -> ([usize; 2], f32) {
    let position = ((at as f32 + 0.5) / side as f32 - 0.5).clamp(0.0, (squares - 1) as f32);
    let first = position as usize;
    ([first, (first + 1).min(squares - 1)], position - first as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_have_one_value_or_are_interpolated() {
        let mut image = Planes::new(2, 1, 1);
        image.data_mut().copy_from_slice(&[1.0, 5.0]);
        // The last square is cut off.
        assert_eq!(enlarged(&image, 4, (6, 2)).data()[..6], [1.0, 1.0, 1.0, 1.0, 5.0, 5.0]);
        assert_eq!(interpolated(&image, 4, (6, 2)).data()[6..], [1.0, 1.0, 1.5, 2.5, 3.5, 4.5]);
        assert_eq!(interpolated(&image, 1, (2, 1)), image);
    }
}
