//! Textures: expression trees over images and constants.
//!
//! A texture refers to earlier ones by index, so that the trees have no cycles. Constant expressions
//! are folded when they are added, so that every constant texture is a [`Texture::Constant`].

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};

use super::floor::{floor, floor3};
use super::procedural::{self, Procedural};
use super::texture_id::{FloatTextureId, ImageId, RgbTextureId};
use super::texture_image::{Texel, TextureImage, WrapMode};
use super::texture_mapping::{TextureMapping, TexturePoint};
use super::texture_value::TextureValue;

/// A texture with values of type `V`: `f32` or linear RGB.
#[derive(Clone, Debug)]
pub enum Texture<V: TextureValue> {
    /// The same value everywhere.
    Constant(V),
    /// An image.
    Image(ImageTexture),
    /// `even` where the sum of the integer parts of the coordinates is even, and `odd` elsewhere.
    Checkerboard { mapping: TextureMapping, even: V::Id, odd: V::Id },
    /// `inside` in randomly placed dots, and `outside` elsewhere.
    Dots { mapping: TextureMapping, inside: V::Id, outside: V::Id },
    /// Bilinear interpolation of the values at (s, t) = (0, 0), (0, 1), (1, 0) and (1, 1).
    Bilinear { mapping: TextureMapping, corners: [V; 4] },
    /// A function of the position in texture space.
    Procedural { to_texture: Affine3A, kind: Procedural },
    /// The product of two textures.
    Product { first: V::Id, second: V::Id },
    /// Linear interpolation from `first` to `second` by `amount`.
    Mix { first: V::Id, second: V::Id, amount: FloatTextureId },
    /// A scalar texture in all channels.
    Gray(FloatTextureId),
    /// The mean of an RGB texture's channels.
    Mean(RgbTextureId),
    /// 0 where a scalar texture is 0, and 1 elsewhere.
    NotZero(FloatTextureId),
}

/// An image on a surface. (s, t) = (0, 0) is the image's top left corner, (1, 1) its bottom right.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    pub image: ImageId,
    pub mapping: TextureMapping,
    pub wrap: WrapMode,
    pub filter: ImageFilter,
    /// Scale factor of the image's values.
    pub scale: f32,
    /// Replaces the scaled value by 1 − value, clamped to at least 0.
    pub invert: bool,
}

/// How an image is looked up between the centres of its texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImageFilter {
    #[default]
    Bilinear,
    Nearest,
}

/// A texture value whose textures are stored in [`Textures`].
pub trait PooledValue: Texel {
    /// The id of the texture at `index`.
    fn id(index: u32) -> Self::Id;
    /// The texture with this id.
    fn texture(textures: &Textures, id: Self::Id) -> &Texture<Self>;
    /// All textures with values of this type.
    fn pool(textures: &mut Textures) -> &mut Vec<Texture<Self>>;
}

impl PooledValue for f32 {
    fn id(index: u32) -> FloatTextureId {
        FloatTextureId(index)
    }
    fn texture(textures: &Textures, id: FloatTextureId) -> &Texture<Self> {
        &textures.floats[id.0 as usize]
    }
    fn pool(textures: &mut Textures) -> &mut Vec<Texture<Self>> {
        &mut textures.floats
    }
}

impl PooledValue for Vec3 {
    fn id(index: u32) -> RgbTextureId {
        RgbTextureId(index)
    }
    fn texture(textures: &Textures, id: RgbTextureId) -> &Texture<Self> {
        &textures.rgbs[id.0 as usize]
    }
    fn pool(textures: &mut Textures) -> &mut Vec<Texture<Self>> {
        &mut textures.rgbs
    }
}

/// All textures and images of a scene.
#[derive(Clone, Debug, Default)]
pub struct Textures {
    floats: Vec<Texture<f32>>,
    rgbs: Vec<Texture<Vec3>>,
    images: Vec<Arc<TextureImage>>,
}

impl Textures {
    /// Value of a scalar texture.
    #[inline]
    pub fn float(&self, id: FloatTextureId, at: TexturePoint) -> f32 {
        self.value::<f32>(id, at)
    }

    /// Value of an RGB texture.
    #[inline]
    pub fn rgb(&self, id: RgbTextureId, at: TexturePoint) -> Vec3 {
        self.value::<Vec3>(id, at)
    }

    /// The value of a constant scalar texture.
    pub fn constant_float(&self, id: FloatTextureId) -> Option<f32> {
        self.constant::<f32>(id)
    }

    /// The value of a constant RGB texture.
    pub fn constant_rgb(&self, id: RgbTextureId) -> Option<Vec3> {
        self.constant::<Vec3>(id)
    }

    /// The step in u and v that resolves the images of a scalar texture: a texel of the finest. Infinite without images that are mapped
    /// by u and v.
    pub fn texel_step(&self, id: FloatTextureId) -> f32 {
        self.step::<f32>(id)
    }

    /// All scalar textures, indexed by [`FloatTextureId`].
    pub fn floats(&self) -> &[Texture<f32>] {
        &self.floats
    }

    /// All RGB textures, indexed by [`RgbTextureId`].
    pub fn rgbs(&self) -> &[Texture<Vec3>] {
        &self.rgbs
    }

    /// All images.
    pub fn images(&self) -> &[Arc<TextureImage>] {
        &self.images
    }

    /// The image with this id.
    pub fn image(&self, id: ImageId) -> &TextureImage {
        &self.images[id.0 as usize]
    }

    /// The image with this id, for shared ownership.
    pub fn shared_image(&self, id: ImageId) -> Arc<TextureImage> {
        self.images[id.0 as usize].clone()
    }

    /// Adds a texture. Textures that it refers to must already be in `self`.
    pub fn add<V: PooledValue>(&mut self, texture: Texture<V>) -> V::Id {
        let texture = self.folded(texture);
        let pool = V::pool(self);
        pool.push(texture);
        V::id((pool.len() - 1) as u32)
    }

    /// Adds an image.
    pub fn add_image(&mut self, image: TextureImage) -> ImageId {
        self.images.push(Arc::new(image));
        ImageId((self.images.len() - 1) as u32)
    }

    fn step<V: PooledValue>(&self, id: V::Id) -> f32 {
        match V::texture(self, id) {
            Texture::Image(ImageTexture { image, mapping: TextureMapping::Uv { scale, .. }, .. }) => {
                let image = self.image(*image);
                let texels = scale.abs() * Vec2::new(image.width() as f32, image.height() as f32);
                texels.max_element().recip()
            }
            Texture::Checkerboard { even: a, odd: b, .. }
            | Texture::Dots { inside: a, outside: b, .. }
            | Texture::Product { first: a, second: b } => self.step::<V>(*a).min(self.step::<V>(*b)),
            Texture::Mix { first, second, amount } => {
                self.step::<V>(*first).min(self.step::<V>(*second)).min(self.step::<f32>(*amount))
            }
            Texture::Gray(float) | Texture::NotZero(float) => self.step::<f32>(*float),
            Texture::Mean(rgb) => self.step::<Vec3>(*rgb),
            Texture::Constant(_)
            | Texture::Image(_)
            | Texture::Bilinear { .. }
            | Texture::Procedural { .. } => f32::INFINITY,
        }
    }

    fn constant<V: PooledValue>(&self, id: V::Id) -> Option<V> {
        match V::texture(self, id) {
            Texture::Constant(value) => Some(*value),
            _ => None,
        }
    }

    /// Folds a texture whose operands are constant.
    fn folded<V: PooledValue>(&self, texture: Texture<V>) -> Texture<V> {
        let value = match &texture {
            Texture::Product { first, second } => {
                self.constant::<V>(*first).zip(self.constant::<V>(*second)).map(|(a, b)| a * b)
            }
            Texture::Mix { first, second, amount } => self
                .constant::<V>(*first)
                .zip(self.constant::<V>(*second))
                .zip(self.constant_float(*amount))
                .map(|((a, b), t)| a * (1.0 - t) + b * t),
            Texture::Gray(float) => self.constant_float(*float).map(V::splat),
            Texture::Mean(rgb) => self.constant_rgb(*rgb).map(|value| V::splat(mean(value))),
            Texture::NotZero(float) => self.constant_float(*float).map(|value| V::splat(not_zero(value))),
            Texture::Constant(_)
            | Texture::Image(_)
            | Texture::Checkerboard { .. }
            | Texture::Dots { .. }
            | Texture::Bilinear { .. }
            | Texture::Procedural { .. } => None,
        };
        value.map_or(texture, Texture::Constant)
    }

    #[inline]
    fn value<V: PooledValue>(&self, id: V::Id, at: TexturePoint) -> V {
        match V::texture(self, id) {
            Texture::Constant(value) => *value,
            varied => self.varied_value(varied, at),
        }
    }

    /// The value of a texture that is not constant.
    fn varied_value<V: PooledValue>(&self, texture: &Texture<V>, at: TexturePoint) -> V {
        match texture {
            Texture::Constant(value) => *value,
            Texture::Image(texture) => self.image_value(texture, at),
            Texture::Checkerboard { mapping, even, odd } => {
                let cell = floor3(mapping.coordinates(at));
                let half = 0.5 * (cell.x + cell.y + cell.z);
                let is_even = half == floor(half);
                self.value::<V>(if is_even { *even } else { *odd }, at)
            }
            Texture::Dots { mapping, inside, outside } => {
                let is_inside = procedural::in_dot(mapping.coordinates(at).truncate());
                self.value::<V>(if is_inside { *inside } else { *outside }, at)
            }
            Texture::Bilinear { mapping, corners: [c00, c01, c10, c11] } => {
                let Vec3 { x: s, y: t, .. } = mapping.coordinates(at);
                (*c00 * (1.0 - t) + *c01 * t) * (1.0 - s) + (*c10 * (1.0 - t) + *c11 * t) * s
            }
            Texture::Procedural { to_texture, kind } => kind.value(to_texture.transform_point3(at.position)),
            Texture::Product { first, second } => self.value::<V>(*first, at) * self.value::<V>(*second, at),
            Texture::Mix { first, second, amount } => {
                let t = self.float(*amount, at);
                self.value::<V>(*first, at) * (1.0 - t) + self.value::<V>(*second, at) * t
            }
            Texture::Gray(float) => V::splat(self.float(*float, at)),
            Texture::Mean(id) => V::splat(mean(self.rgb(*id, at))),
            Texture::NotZero(float) => V::splat(not_zero(self.float(*float, at))),
        }
    }

    fn image_value<V: PooledValue>(&self, texture: &ImageTexture, at: TexturePoint) -> V {
        let st = texture.mapping.coordinates(at).truncate();
        let image = self.image(texture.image);
        let value = match texture.filter {
            ImageFilter::Bilinear => image.bilinear::<V>(st, texture.wrap),
            ImageFilter::Nearest => image.nearest::<V>(st, texture.wrap),
        } * texture.scale;
        if texture.invert { (V::splat(1.0) + value * -1.0).clamp_zero() } else { value }
    }
}

fn mean(colour: Vec3) -> f32 {
    colour.element_sum() / 3.0
}

fn not_zero(value: f32) -> f32 {
    if value == 0.0 { 0.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(u: f32, v: f32) -> TexturePoint {
        TexturePoint { uv: Vec2::new(u, v), position: Vec3::new(u, v, 0.0) }
    }

    #[test]
    fn constant_expressions_are_folded() {
        let mut textures = Textures::default();
        let half = textures.add(Texture::Constant(0.5));
        let red = textures.add(Texture::Constant(Vec3::new(1.0, 0.0, 0.0)));
        let gray = textures.add(Texture::<Vec3>::Gray(half));
        let product = textures.add(Texture::<Vec3>::Product { first: red, second: gray });
        let mix = textures.add(Texture::<Vec3>::Mix { first: red, second: product, amount: half });
        assert_eq!(textures.constant_rgb(product), Some(Vec3::new(0.5, 0.0, 0.0)));
        assert_eq!(textures.constant_rgb(mix), Some(Vec3::new(0.75, 0.0, 0.0)));
        assert_eq!(textures.rgb(mix, at(0.3, 0.3)), Vec3::new(0.75, 0.0, 0.0));
    }

    #[test]
    fn a_checkerboard_alternates_on_both_axes_and_below_zero() {
        let mut textures = Textures::default();
        let even = textures.add(Texture::Constant(1.0));
        let odd = textures.add(Texture::Constant(0.0));
        let mapping = TextureMapping::Uv { scale: Vec2::new(2.0, 2.0), offset: Vec2::ZERO };
        let board = textures.add(Texture::<f32>::Checkerboard { mapping, even, odd });
        assert_eq!(textures.constant_float(board), None);
        let values = [(0.1, 0.1), (0.6, 0.1), (0.6, 0.6), (-0.1, 0.1), (-0.1, -0.1)]
            .map(|(u, v)| textures.float(board, at(u, v)));
        assert_eq!(values, [1.0, 0.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn dots_and_bilinear_corners_are_evaluated() {
        let mut textures = Textures::default();
        let [inside, outside] = [1.0, 0.0].map(|value| textures.add(Texture::Constant(value)));
        let mapping = TextureMapping::Uv { scale: Vec2::splat(20.0), offset: Vec2::ZERO };
        let dots = textures.add(Texture::<f32>::Dots { mapping, inside, outside });
        let n = 200;
        let values: Vec<f32> = (0..n * n)
            .map(|i| textures.float(dots, at((i % n) as f32 / n as f32, (i / n) as f32 / n as f32)))
            .collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        assert!(values.iter().all(|v| *v == 0.0 || *v == 1.0) && mean > 0.1 && mean < 0.35, "{mean}");

        let mapping = TextureMapping::Uv { scale: Vec2::ONE, offset: Vec2::ZERO };
        let plane = textures.add(Texture::<f32>::Bilinear { mapping, corners: [1.0, 2.0, 4.0, 8.0] });
        let found = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.5)];
        assert_eq!(found.map(|(u, v)| textures.float(plane, at(u, v))), [1.0, 2.0, 4.0, 8.0, 3.75]);
    }

    #[test]
    fn an_inverted_and_scaled_image_stays_above_zero() {
        let mut textures = Textures::default();
        let image = textures.add_image(TextureImage::from_floats(2, 1, 1, vec![0.25, 4.0]));
        let mapping = TextureMapping::Uv { scale: Vec2::ONE, offset: Vec2::ZERO };
        let (wrap, filter) = (WrapMode::Clamp, ImageFilter::Bilinear);
        let texture = ImageTexture { image, mapping, wrap, filter, scale: 2.0, invert: true };
        let id = textures.add(Texture::<f32>::Image(texture));
        assert_eq!(textures.float(id, at(0.25, 0.5)), 0.5);
        assert_eq!(textures.float(id, at(0.75, 0.5)), 0.0);
        let half = textures.add(Texture::Constant(0.5));
        let product = textures.add(Texture::<f32>::Product { first: half, second: id });
        assert_eq!([half, id, product].map(|id| textures.texel_step(id)), [f32::INFINITY, 0.5, 0.5]);
    }
}
