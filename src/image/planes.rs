//! The container for per-pixel data: one plane for each quantity, so that loops over rows become vector
//! code.

/// Several planes of `width`×`height` values, one after the other, each row by row from the top left.
///
/// Images have 3 planes (R, G, B), feature buffers any number, maps 1.
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

    /// One plane, row by row.
    pub fn plane_mut(&mut self, plane: usize) -> &mut [f32] {
        let pixels = self.pixels();
        &mut self.data[plane * pixels..][..pixels]
    }

    /// One row of one plane.
    pub fn row(&self, plane: usize, y: usize) -> &[f32] {
        &self.plane(plane)[y * self.width..][..self.width]
    }

    /// One row of one plane.
    pub fn row_mut(&mut self, plane: usize, y: usize) -> &mut [f32] {
        let width = self.width;
        &mut self.plane_mut(plane)[y * width..][..width]
    }

    /// All planes, one after the other.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// All planes, one after the other.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// Returns all planes, one after the other, without a copy.
    pub fn into_data(self) -> Vec<f32> {
        self.data
    }

    /// Iterates over the planes.
    pub fn planes_mut(&mut self) -> std::slice::ChunksMut<'_, f32> {
        let pixels = self.pixels().max(1);
        self.data.chunks_mut(pixels)
    }

    /// Replaces the pixels from `to` on by those of an image with as many planes, from `from` on: `size` columns and rows.
    ///
    /// # Panics
    /// If they are not within the images.
    pub fn paste(&mut self, image: &Self, from: [usize; 2], to: [usize; 2], size: [usize; 2]) {
        let width = self.width;
        for plane in 0..self.count {
            for y in 0..size[1] {
                let row = &image.row(plane, from[1] + y)[from[0]..][..size[0]];
                self.plane_mut(plane)[(to[1] + y) * width + to[0]..][..size[0]].copy_from_slice(row);
            }
        }
    }

    /// Returns the mean of the first three planes at a pixel: the mean of an image's channels.
    pub fn channel_mean(&self, pixel: usize) -> f32 {
        (0..3).map(|channel| self.plane(channel)[pixel]).sum::<f32>() / 3.0
    }

    /// The value of a pixel.
    pub fn at(&self, plane: usize, x: usize, y: usize) -> f32 {
        self.plane(plane)[y * self.width + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pasted_pixels_come_from_their_place() {
        let mut image = Planes::new(4, 3, 2);
        let mut other = Planes::new(3, 3, 2);
        other.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = 1.0 + i as f32);
        image.paste(&other, [1, 0], [2, 1], [2, 2]);
        assert_eq!(image.plane(0), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 3.0, 0.0, 0.0, 5.0, 6.0]);
        assert_eq!(image.row(1, 2), [0.0, 0.0, 14.0, 15.0]);
    }

    #[test]
    fn the_mean_of_the_channels_is_that_of_a_pixel() {
        let mut image = Planes::new(2, 1, 3);
        image.data_mut().copy_from_slice(&[1.0, 2.0, 3.0, 4.0, 8.0, 9.0]);
        assert_eq!([image.channel_mean(0), image.channel_mean(1)], [4.0, 5.0]);
    }
}
