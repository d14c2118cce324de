//! The container that every room shares for per-pixel data: planes, so that the hot loops run over
//! rows of one quantity and vectorise.

/// Several planes of `width`×`height` values, plane by plane, each row by row from the top left.
///
/// The one container for images (3 planes: R, G, B), feature buffers and maps (1 plane).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planes {
    width: usize,
    height: usize,
    count: usize,
    data: Vec<f32>,
}

impl Planes {
    /// `count` planes filled with zero.
    pub fn new(width: usize, height: usize, count: usize) -> Self {
        Self { width, height, count, data: vec![0.0; width * height * count] }
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    /// Number of planes.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Pixels per plane.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// One plane, row by row.
    pub fn plane(&self, plane: usize) -> &[f32] {
        &self.data[plane * self.pixels()..][..self.pixels()]
    }

    pub fn plane_mut(&mut self, plane: usize) -> &mut [f32] {
        let pixels = self.pixels();
        &mut self.data[plane * pixels..][..pixels]
    }

    /// One row of one plane.
    pub fn row(&self, plane: usize, y: usize) -> &[f32] {
        &self.plane(plane)[y * self.width..][..self.width]
    }

    /// All planes, one after the other.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// The planes one by one, for parallel writing.
    pub fn planes_mut(&mut self) -> std::slice::ChunksMut<'_, f32> {
        let pixels = self.pixels().max(1);
        self.data.chunks_mut(pixels)
    }

    /// Value at a pixel.
    pub fn at(&self, plane: usize, x: usize, y: usize) -> f32 {
        self.plane(plane)[y * self.width + x]
    }
}
