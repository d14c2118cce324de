//! Planes for kernels that look at whole windows: rows with a margin, so that no access needs a
//! bounds test, and all planes of a row side by side, so that rows can be written in parallel.

use crate::image::Planes;

/// Neighbouring pixels of a row that a kernel works on at once.
pub(super) const LANES: usize = 16;

/// `[row][plane][margin + x]`, the margins filled with one value.
#[derive(Clone, Debug)]
pub(super) struct Padded {
    width: usize,
    height: usize,
    count: usize,
    margin: usize,
    stride: usize,
    /// The rows, and another `stride` values so that [`Self::from`] can cut equal pieces.
    data: Vec<f32>,
}

impl Padded {
    pub fn new(width: usize, height: usize, count: usize, margin: usize, fill: f32) -> Self {
        // Whole cache lines, and an odd number of them: planes then do not compete for cache sets.
        let lines = (2 * margin + width.next_multiple_of(LANES)).div_ceil(LANES);
        let stride = (lines | 1) * LANES;
        let data = vec![fill; (height * count + 1) * stride];
        Self { width, height, count, margin, stride, data }
    }

    /// A copy of some planes.
    pub fn from_planes(planes: &Planes, margin: usize, fill: f32) -> Self {
        let mut padded = Self::new(planes.width(), planes.height(), planes.count(), margin, fill);
        for plane in 0..planes.count() {
            for y in 0..planes.height() {
                padded.row_mut(plane, y).copy_from_slice(planes.row(plane, y));
            }
        }
        padded
    }

    /// The planes without margins.
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

    /// Values from one plane of a row to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Values from one row to the next.
    pub fn row_len(&self) -> usize {
        self.count * self.stride
    }

    /// One row of one plane, margins included.
    #[inline]
    pub fn wide(&self, plane: usize, y: usize) -> &[f32] {
        &self.data[(y * self.count + plane) * self.stride..][..self.stride]
    }

    /// The planes of a row, each from `at` values after its margin's start on. They go on past the
    /// plane's end, all to the same length.
    #[inline(always)]
    pub fn from(&self, y: usize, at: usize) -> std::slice::ChunksExact<'_, f32> {
        self.data[y * self.row_len() + at..][..self.row_len()].chunks_exact(self.stride)
    }

    /// One row of one plane.
    #[inline]
    pub fn row(&self, plane: usize, y: usize) -> &[f32] {
        &self.wide(plane, y)[self.margin..][..self.width]
    }

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

    /// All rows, one after the other, for parallel writing in chunks of [`Self::row_len`].
    pub fn data_mut(&mut self) -> &mut [f32] {
        let rows = self.height * self.row_len();
        &mut self.data[..rows]
    }

    /// A block of neighbouring pixels; `x` a multiple of [`LANES`].
    #[inline]
    pub fn lanes(&self, plane: usize, y: usize, x: usize) -> &[f32; LANES] {
        let start = (y * self.count + plane) * self.stride + self.margin + x;
        self.data[start..start + LANES].try_into().expect("the slice has this length")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARGIN: usize = 5;

    fn numbers(width: usize, height: usize, count: usize) -> Planes {
        let mut planes = Planes::new(width, height, count);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = i as f32);
        planes
    }

    #[test]
    fn every_way_to_read_finds_the_same_pixel() {
        for (width, height, count) in [(21, 4, 3), (16, 2, 1), (1, 1, 2), (33, 3, 7)] {
            let planes = numbers(width, height, count);
            let padded = Padded::from_planes(&planes, MARGIN, -1.0);
            assert_eq!((padded.width(), padded.height(), padded.count()), (width, height, count));
            assert_eq!((padded.margin(), padded.row_len()), (MARGIN, count * padded.stride()));
            // Whole cache lines, an odd number of them.
            assert_eq!(padded.stride() / LANES % 2, 1);
            assert_eq!(padded.stride() % LANES, 0);
            assert_eq!(padded.to_planes(), planes);
            for (plane, y) in (0..count).flat_map(|plane| (0..height).map(move |y| (plane, y))) {
                assert_eq!(padded.row(plane, y), planes.row(plane, y));
                let wide = padded.wide(plane, y);
                assert_eq!(wide.len(), padded.stride());
                assert!(wide[..MARGIN].iter().chain(&wide[MARGIN + width..]).all(|&v| v == -1.0));
                assert_eq!(wide[MARGIN..MARGIN + width], *planes.row(plane, y));
                for x in 0..width {
                    assert_eq!(padded.at(plane, x, y), planes.at(plane, x, y));
                    let from = padded.from(y, MARGIN + x).nth(plane).expect("as many as planes");
                    assert_eq!(from[0], planes.at(plane, x, y));
                    assert_eq!(padded.from(y, MARGIN + x).len(), count);
                }
                for x in (0..width).step_by(LANES) {
                    let lanes = padded.lanes(plane, y, x);
                    let inside = LANES.min(width - x);
                    assert_eq!(lanes[..inside], planes.row(plane, y)[x..x + inside]);
                }
            }
        }
    }

    #[test]
    fn what_is_written_is_read_and_nothing_else_changes() {
        let mut padded = Padded::from_planes(&numbers(7, 3, 2), MARGIN, -1.0);
        padded.set(1, 3, 2, 500.0);
        padded.row_mut(0, 1)[6] = 600.0;
        let row_len = padded.row_len();
        assert_eq!(padded.data_mut().len(), 3 * row_len);
        let stride = padded.stride();
        padded.data_mut()[2 * row_len + stride + MARGIN] = 700.0;
        let mut expected = numbers(7, 3, 2);
        expected.plane_mut(1)[2 * 7 + 3] = 500.0;
        expected.plane_mut(0)[7 + 6] = 600.0;
        expected.plane_mut(1)[2 * 7] = 700.0;
        assert_eq!(padded.to_planes(), expected);
    }
}
