//! Images in memory, as compact as in their file, and bilinear lookup.

use glam::{DVec3, Vec2, Vec3};

use super::floor::floor;
use super::texture_value::TextureValue;

/// Values beyond the borders of an image (pbrt's `WrapMode`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrapMode {
    Repeat,
    /// Zero.
    Black,
    /// The texel at the border.
    Clamp,
}

/// An image with 1 (gray), 3 (RGB) or 4 (RGB and alpha) channels, in rows from the top left.
#[derive(Clone, Debug)]
pub struct TextureImage {
    width: usize,
    height: usize,
    channels: usize,
    texels: Texels,
}

#[derive(Clone, Debug)]
enum Texels {
    /// Encoded bytes and the linear value of each; alpha is always linear.
    Bytes {
        data: Vec<u8>,
        decode: Box<[f32; 256]>,
    },
    Floats(Vec<f32>),
}

impl TextureImage {
    /// An image from linear values.
    ///
    /// # Panics
    /// If `data` does not hold `width`·`height`·`channels` values.
    pub fn from_floats(width: usize, height: usize, channels: usize, data: Vec<f32>) -> Self {
        assert_eq!(data.len(), width * height * channels, "data must fit the size");
        Self { width, height, channels, texels: Texels::Floats(data) }
    }

    /// An image from encoded bytes; `decode` holds the linear value of each.
    ///
    /// # Panics
    /// As [`Self::from_floats`].
    pub fn from_bytes(
        width: usize,
        height: usize,
        channels: usize,
        data: Vec<u8>,
        decode: Box<[f32; 256]>,
    ) -> Self {
        assert_eq!(data.len(), width * height * channels, "data must fit the size");
        Self { width, height, channels, texels: Texels::Bytes { data, decode } }
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    /// Number of channels of a texel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Bytes of memory for the texels.
    pub fn memory_bytes(&self) -> usize {
        match &self.texels {
            Texels::Bytes { data, .. } => data.len(),
            Texels::Floats(data) => data.len() * size_of::<f32>(),
        }
    }

    /// Linear RGB of a texel; x < width, y < height, (0, 0) is the top left.
    #[inline]
    pub fn rgb(&self, x: usize, y: usize) -> Vec3 {
        let first = (y * self.width + x) * self.channels;
        match &self.texels {
            Texels::Bytes { data, decode } => {
                gray_or_rgb(&data[first..][..self.channels], |&byte| decode[usize::from(byte)])
            }
            Texels::Floats(data) => gray_or_rgb(&data[first..][..self.channels], |&value| value),
        }
    }

    /// The image flipped vertically.
    pub fn upside_down(mut self) -> Self {
        let row = self.width * self.channels;
        match &mut self.texels {
            Texels::Bytes { data, .. } => reverse_rows(data, row),
            Texels::Floats(data) => reverse_rows(data, row),
        }
        self
    }

    /// Mean linear RGB over the texels, with negative values clamped to 0, as for emission.
    pub fn mean_light(&self) -> Vec3 {
        let cells = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let sum: DVec3 = cells.map(|(x, y)| self.rgb(x, y).max(Vec3::ZERO).as_dvec3()).sum();
        (sum / (self.width * self.height).max(1) as f64).as_vec3()
    }

    /// Scalar value of a texel: the gray value, the mean of R, G and B, or alpha if there is one (as in
    /// pbrt-v4).
    pub fn float(&self, x: usize, y: usize) -> f32 {
        match self.channels {
            4 => self.alpha((y * self.width + x) * 4 + 3),
            3 => self.rgb(x, y).element_sum() / 3.0,
            _ => self.rgb(x, y).x,
        }
    }

    fn alpha(&self, index: usize) -> f32 {
        match &self.texels {
            Texels::Bytes { data, .. } => f32::from(data[index]) / 255.0,
            Texels::Floats(data) => data[index],
        }
    }

    /// Value of the texel at (s, t), which run over [0, 1]² from the top left.
    pub fn nearest<V: Texel>(&self, st: Vec2, wrap: WrapMode) -> V {
        let position = (st * Vec2::new(self.width as f32, self.height as f32)).map(floor);
        // `as` saturates, and takes NaN for 0
        let [x, y] =
            [(position.x, self.width), (position.y, self.height)].map(|(i, size)| wrap.index(i as i64, size));
        x.zip(y).map_or(V::splat(0.0), |(x, y)| V::texel(self, x, y))
    }

    /// Bilinearly filtered value at (s, t), which run over [0, 1]² from the top left.
    pub fn bilinear<V: Texel>(&self, st: Vec2, wrap: WrapMode) -> V {
        let position = st * Vec2::new(self.width as f32, self.height as f32) - 0.5;
        let corner = position.map(floor);
        let Vec2 { x: fx, y: fy } = position - corner;
        if !(fx >= 0.0 && fy >= 0.0) {
            // The coordinates overflowed to NaN
            return V::splat(0.0);
        }
        let columns = wrap.neighbours(corner.x, self.width);
        let row = |y: Option<usize>| {
            let texel = |x: Option<usize>| match (x, y) {
                (Some(x), Some(y)) => V::texel(self, x, y),
                _ => V::splat(0.0),
            };
            texel(columns[0]) * (1.0 - fx) + texel(columns[1]) * fx
        };
        let [y0, y1] = wrap.neighbours(corner.y, self.height);
        row(y0) * (1.0 - fy) + row(y1) * fy
    }
}

impl WrapMode {
    /// Indices, below `size`, of the texels at the integer `i` and after it along an axis; `None` for zero.
    #[inline]
    fn neighbours(self, i: f32, size: usize) -> [Option<usize>; 2] {
        // `as` saturates to `i32`, whose neighbours fit an `i64`
        let i = i64::from(i as i32);
        match usize::try_from(i) {
            Ok(i) if i + 1 < size => [Some(i), Some(i + 1)],
            _ => [i, i + 1].map(|i| self.index(i, size)),
        }
    }

    /// Index, below `size`, of the texel at `i`, which may be beyond the borders.
    fn index(self, i: i64, size: usize) -> Option<usize> {
        match self {
            WrapMode::Repeat => Some(i.rem_euclid(size as i64) as usize),
            WrapMode::Clamp => Some(i.clamp(0, size as i64 - 1) as usize),
            WrapMode::Black => usize::try_from(i).ok().filter(|&i| i < size),
        }
    }
}

/// The gray value in all channels, or red, green and blue of a texel.
#[inline]
fn gray_or_rgb<T>(texel: &[T], linear: impl Fn(&T) -> f32) -> Vec3 {
    match texel {
        [red, green, blue, ..] => Vec3::new(linear(red), linear(green), linear(blue)),
        _ => texel.first().map_or(Vec3::ZERO, |gray| Vec3::splat(linear(gray))),
    }
}

/// A texture value that an image provides.
pub trait Texel: TextureValue {
    /// The value at a texel; x < width, y < height.
    fn texel(image: &TextureImage, x: usize, y: usize) -> Self;
}

impl Texel for f32 {
    #[inline]
    fn texel(image: &TextureImage, x: usize, y: usize) -> Self {
        image.float(x, y)
    }
}

impl Texel for Vec3 {
    #[inline]
    fn texel(image: &TextureImage, x: usize, y: usize) -> Self {
        image.rgb(x, y)
    }
}

fn reverse_rows<T: Copy>(data: &mut Vec<T>, row: usize) {
    *data = data.chunks_exact(row.max(1)).rev().flatten().copied().collect();
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2×2: the top row is 1, 2; the bottom row 3, 4.
    fn image() -> TextureImage {
        TextureImage::from_floats(2, 2, 1, vec![1.0, 2.0, 3.0, 4.0])
    }

    #[test]
    fn texel_centres_have_the_texels_values() {
        let values = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
            .map(|(s, t)| image().bilinear::<f32>(Vec2::new(s, t), WrapMode::Repeat));
        assert_eq!(values, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(image().bilinear::<f32>(Vec2::splat(0.5), WrapMode::Repeat), 2.5);
    }

    #[test]
    fn the_nearest_texel_is_the_one_around_a_point() {
        let at = |s, t, wrap| image().nearest::<f32>(Vec2::new(s, t), wrap);
        assert_eq!([at(0.01, 0.49, WrapMode::Repeat), at(0.51, 0.99, WrapMode::Repeat)], [1.0, 4.0]);
        assert_eq!(
            [WrapMode::Repeat, WrapMode::Clamp, WrapMode::Black].map(|w| at(-0.1, 0.2, w)),
            [2.0, 1.0, 0.0]
        );
        assert!(at(f32::NAN, f32::INFINITY, WrapMode::Repeat).is_finite());
    }

    #[test]
    fn an_image_upside_down_has_its_rows_in_reverse() {
        let turned = image().upside_down();
        assert_eq!([turned.float(0, 0), turned.float(1, 1)], [3.0, 2.0]);
        let bytes = TextureImage::from_bytes(1, 2, 3, vec![1, 2, 3, 4, 5, 6], Box::new([0.5; 256]));
        let Texels::Bytes { data, .. } = bytes.upside_down().texels else { panic!() };
        assert_eq!(data, [4, 5, 6, 1, 2, 3]);
    }

    #[test]
    fn negative_texels_count_as_zero_emission() {
        let image = TextureImage::from_floats(2, 1, 1, vec![-5.0, 1.0]);
        assert_eq!(image.mean_light(), Vec3::splat(0.5));
    }

    #[test]
    fn wrap_modes_repeat_clamp_or_are_black() {
        let at = |wrap| image().bilinear::<f32>(Vec2::new(-0.25, 0.25), wrap);
        assert_eq!(at(WrapMode::Repeat), 2.0);
        assert_eq!(at(WrapMode::Clamp), 1.0);
        assert_eq!(at(WrapMode::Black), 0.0);
    }

    #[test]
    fn overflowing_coordinates_give_finite_values() {
        for st in [f32::NAN, f32::INFINITY, -1e30, 1e30] {
            for wrap in [WrapMode::Repeat, WrapMode::Clamp, WrapMode::Black] {
                assert!(image().bilinear::<f32>(Vec2::splat(st), wrap).is_finite());
            }
        }
    }

    #[test]
    fn scalar_values_are_the_mean_or_alpha() {
        let rgb = TextureImage::from_floats(1, 1, 3, vec![0.0, 0.3, 0.6]);
        assert!((rgb.float(0, 0) - 0.3).abs() < 1e-6);
        let mut decode = Box::new([0.0; 256]);
        decode[200] = 7.0;
        let rgba = TextureImage::from_bytes(1, 1, 4, vec![200, 0, 0, 51], decode);
        assert_eq!(rgba.float(0, 0), 0.2);
        assert_eq!(rgba.rgb(0, 0), Vec3::new(7.0, 0.0, 0.0));
    }
}
