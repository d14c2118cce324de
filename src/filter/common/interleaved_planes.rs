//! Planes stored row by row for kernels that read whole windows: the planes of one row lie side by
//! side, so that tasks write disjoint rows, and each row has a margin on its left and right, so that
//! no access needs a bounds test.
//!
//! The planes are read with vector loads of [`LANES`] pixels. [`PaddedPlanes`](super::padded_planes)
//! have margins on all four sides and store plane after plane.

use rayon::prelude::*;

use super::lanes::lanes;
use crate::image::Planes;
use crate::simd::{LANES, Lanes};

/// Planes in the order `[row][plane][margin + x]`.
#[derive(Clone, Debug)]
pub struct InterleavedPlanes {
    width: usize,
    height: usize,
    count: usize,
    margin: usize,
    stride: usize,
    /// The rows and another `stride` values, so that [`Self::row_planes`] returns equal chunks.
    data: Vec<f32>,
}

impl InterleavedPlanes {
    /// `count` planes of `width`×`height` pixels with `margin` pixels left and right, all `fill`.
    pub fn new(width: usize, height: usize, count: usize, margin: usize, fill: f32) -> Self {
        // An odd number of cache lines keeps the planes of a row from competing for cache sets.
        let lines = (2 * margin + width.next_multiple_of(LANES)).div_ceil(LANES);
        let stride = (lines | 1) * LANES;
        let data = vec![fill; (height * count + 1) * stride];
        Self { width, height, count, margin, stride, data }
    }

    /// Copies planes; the margins are `fill`.
    pub fn from_planes(planes: &Planes, margin: usize, fill: f32) -> Self {
        let mut interleaved = Self::new(planes.width(), planes.height(), planes.count(), margin, fill);
        let (stride, row_len) = (interleaved.stride, interleaved.row_len().max(1));
        interleaved.data_mut().par_chunks_mut(row_len).enumerate().for_each(|(y, row)| {
            for (plane, out) in row.chunks_mut(stride).enumerate() {
                out[margin..][..planes.width()].copy_from_slice(planes.row(plane, y));
            }
        });
        interleaved
    }

    /// Copies planes; the margins have the values of the nearest pixel.
    pub fn extended(planes: &Planes, margin: usize) -> Self {
        let mut extended = Self::from_planes(planes, margin, 0.0);
        extended.extend();
        extended
    }

    /// Gives the margins the values of the nearest pixel.
    pub fn extend(&mut self) {
        let (margin, width, stride) = (self.margin, self.width, self.stride);
        self.data_mut().par_chunks_mut(stride).for_each(|row| extend(row, margin, width));
    }

    /// Copies the planes without their margins.
    pub fn to_planes(&self) -> Planes {
        let mut planes = Planes::new(self.width, self.height(), self.count);
        for plane in 0..self.count {
            for (y, out) in planes.plane_mut(plane).chunks_mut(self.width.max(1)).enumerate() {
                out.copy_from_slice(self.row(plane, y));
            }
        }
        planes
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn margin(&self) -> usize {
        self.margin
    }

    /// Distance between two planes of a row, in values.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Distance between two rows, in values.
    pub fn row_len(&self) -> usize {
        self.count * self.stride
    }

    /// Returns one row of one plane with its margins.
    #[inline]
    pub fn row_with_margins(&self, plane: usize, y: usize) -> &[f32] {
        &self.data[(y * self.count + plane) * self.stride..][..self.stride]
    }

    /// Returns, for each plane of a row, the values from index `at` of the row with margins on. The
    /// slices have equal lengths and may extend past their plane's end.
    #[inline(always)]
    pub fn row_planes(&self, y: usize, at: usize) -> std::slice::ChunksExact<'_, f32> {
        self.data[y * self.row_len() + at..][..self.row_len()].chunks_exact(self.stride)
    }

    /// Returns `N` values of a row of one plane, from index `at` of the row with margins on. They may extend past its end.
    #[inline(always)]
    pub fn span<const N: usize>(&self, plane: usize, y: usize, at: usize) -> &[f32; N] {
        let start = (y * self.count + plane) * self.stride + at;
        self.data[start..start + N].try_into().expect("as many values")
    }

    /// Returns one row of one plane without margins.
    #[inline]
    pub fn row(&self, plane: usize, y: usize) -> &[f32] {
        &self.row_with_margins(plane, y)[self.margin..][..self.width]
    }

    /// Returns one row of one plane without margins.
    pub fn row_mut(&mut self, plane: usize, y: usize) -> &mut [f32] {
        &mut self.data[(y * self.count + plane) * self.stride + self.margin..][..self.width]
    }

    #[inline]
    pub fn at(&self, plane: usize, x: usize, y: usize) -> f32 {
        self.data[(y * self.count + plane) * self.stride + self.margin + x]
    }

    pub fn set(&mut self, plane: usize, x: usize, y: usize, value: f32) {
        self.data[(y * self.count + plane) * self.stride + self.margin + x] = value;
    }

    /// Returns all rows, for parallel writing in chunks of [`Self::row_len`].
    pub fn data_mut(&mut self) -> &mut [f32] {
        let rows = self.height * self.row_len();
        &mut self.data[..rows]
    }

    /// Returns the [`LANES`] pixels of a row from `x` on; `x` is a multiple of [`LANES`].
    #[inline]
    pub fn lanes(&self, plane: usize, y: usize, x: usize) -> &Lanes {
        let start = (y * self.count + plane) * self.stride + self.margin + x;
        lanes(&self.data[start..])
    }
}

/// Gives the margins of a row the values of the nearest pixel.
pub fn extend(row: &mut [f32], margin: usize, width: usize) {
    let (first, last) = (row[margin], row[margin + width - 1]);
    row[..margin].fill(first);
    row[margin + width..].fill(last);
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARGIN: usize = 5;

    fn numbered(width: usize, height: usize, count: usize) -> Planes {
        let mut planes = Planes::new(width, height, count);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = i as f32);
        planes
    }

    #[test]
    fn all_accessors_return_the_same_pixel() {
        for (width, height, count) in [(21, 4, 3), (16, 2, 1), (1, 1, 2), (33, 3, 7)] {
            let planes = numbered(width, height, count);
            let interleaved = InterleavedPlanes::from_planes(&planes, MARGIN, -1.0);
            assert_eq!(
                (interleaved.width(), interleaved.height(), interleaved.count()),
                (width, height, count)
            );
            assert_eq!((interleaved.margin(), interleaved.row_len()), (MARGIN, count * interleaved.stride()));
            // An odd number of whole cache lines.
            assert_eq!(interleaved.stride() / LANES % 2, 1);
            assert_eq!(interleaved.stride() % LANES, 0);
            assert_eq!(interleaved.to_planes(), planes);
            for (plane, y) in (0..count).flat_map(|plane| (0..height).map(move |y| (plane, y))) {
                assert_eq!(interleaved.row(plane, y), planes.row(plane, y));
                let row = interleaved.row_with_margins(plane, y);
                assert_eq!(row.len(), interleaved.stride());
                assert!(row[..MARGIN].iter().chain(&row[MARGIN + width..]).all(|&v| v == -1.0));
                assert_eq!(row[MARGIN..MARGIN + width], *planes.row(plane, y));
                for x in 0..width {
                    assert_eq!(interleaved.at(plane, x, y), planes.at(plane, x, y));
                    let found = interleaved.row_planes(y, MARGIN + x).nth(plane).expect("as many as planes");
                    assert_eq!(found[0], planes.at(plane, x, y));
                    assert_eq!(interleaved.row_planes(y, MARGIN + x).len(), count);
                }
                for x in (0..width).step_by(LANES) {
                    let lanes = interleaved.lanes(plane, y, x);
                    let inside = LANES.min(width - x);
                    assert_eq!(lanes[..inside], planes.row(plane, y)[x..x + inside]);
                }
            }
        }
    }

    #[test]
    fn writes_change_only_their_pixel() {
        let mut interleaved = InterleavedPlanes::from_planes(&numbered(7, 3, 2), MARGIN, -1.0);
        interleaved.set(1, 3, 2, 500.0);
        interleaved.row_mut(0, 1)[6] = 600.0;
        let row_len = interleaved.row_len();
        assert_eq!(interleaved.data_mut().len(), 3 * row_len);
        let stride = interleaved.stride();
        interleaved.data_mut()[2 * row_len + stride + MARGIN] = 700.0;
        let mut expected = numbered(7, 3, 2);
        expected.plane_mut(1)[2 * 7 + 3] = 500.0;
        expected.plane_mut(0)[7 + 6] = 600.0;
        expected.plane_mut(1)[2 * 7] = 700.0;
        assert_eq!(interleaved.to_planes(), expected);
    }
}
