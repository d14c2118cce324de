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
