//! Textures: small expression trees over images and constants, stored in pools.
//!
//! A texture refers to others by index and only to earlier ones, so that the trees have no
//! cycles. What is constant is folded when it is added: [`Texture::Constant`] is then the only
//! form that a constant texture can have.

mod image;
mod load;
mod pfm;
mod procedural;

use std::sync::Arc;

use std::f32::consts::{PI, TAU};
use std::ops::{Add, Mul};

use glam::{Affine3A, Vec2, Vec3};

pub use self::image::{TextureImage, Wrap};
pub use self::load::{Channels, Encoding, load};
pub use self::procedural::Procedural;

/// Index into the pool of scalar textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FloatTextureId(pub u32);

/// Index into the pool of colour textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RgbTextureId(pub u32);

/// Index into the pool of images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageId(pub u32);

/// Where on a surface a texture is looked up.
#[derive(Clone, Copy, Debug)]
pub struct TexturePoint {
    pub uv: Vec2,
    /// Render-space position, for textures in space.
    pub position: Vec3,
}

/// How a point becomes texture coordinates.
#[derive(Clone, Copy, Debug)]
pub enum Mapping {
    /// (s, t) = scale · (u, v) + offset.
    Uv { scale: Vec2, offset: Vec2 },
    /// (s, t) = the first two coordinates of the point in the texture's space; all three for a
    /// solid texture.
    Space(Affine3A),
    /// (s, t) = angle from z and azimuth in the texture's space, as shares of their ranges.
    Spherical { to_texture: Affine3A, flip: bool },
    /// (s, t) = azimuth, as a share of its range, and height along z in the texture's space.
    Cylindrical { to_texture: Affine3A, flip: bool },
}

impl Mapping {
    fn coordinates(&self, at: TexturePoint) -> Vec3 {
        match self {
            Mapping::Uv { scale, offset } => (*scale * at.uv + *offset).extend(0.0),
            Mapping::Space(to_texture) => to_texture.transform_point3(at.position),
            Mapping::Spherical { to_texture, flip } => {
                let p = to_texture.transform_point3(at.position);
                let azimuth = p.y.atan2(p.x) / TAU;
                let polar = p.truncate().length().atan2(p.z) / PI;
                st(polar, if azimuth < 0.0 { azimuth + 1.0 } else { azimuth }, *flip)
            }
            Mapping::Cylindrical { to_texture, flip } => {
                let p = to_texture.transform_point3(at.position);
                st(0.5 + p.y.atan2(p.x) / TAU, p.z, *flip)
            }
        }
    }
}

/// Coordinates of an image, whose t is counted from the other end if `flip`.
fn st(s: f32, t: f32, flip: bool) -> Vec3 {
    Vec3::new(s, if flip { 1.0 - t } else { t }, 0.0)
}

/// A texture whose values are `V`: `f32` or linear RGB.
#[derive(Clone, Debug)]
pub enum Texture<V: TextureValue> {
    Constant(V),
    Image(ImageTexture),
    /// `even` where the integer parts of the coordinates have an even sum.
    Checkerboard {
        mapping: Mapping,
        even: V::Id,
        odd: V::Id,
    },
    /// `inside` scattered dots, and `outside`.
    Dots {
        mapping: Mapping,
        inside: V::Id,
        outside: V::Id,
    },
    /// Values at (s, t) of (0, 0), (0, 1), (1, 0) and (1, 1), and in straight lines between them.
    Bilinear {
        mapping: Mapping,
        corners: [V; 4],
    },
    /// By the place in the texture's space.
    Procedural {
        to_texture: Affine3A,
        kind: Procedural,
    },
    Product {
        first: V::Id,
        second: V::Id,
    },
    /// `amount` of the second, the rest of the first.
    Mix {
        first: V::Id,
        second: V::Id,
        amount: FloatTextureId,
    },
    /// A scalar texture, the same in every channel.
    Gray(FloatTextureId),
    /// The mean of a coloured texture's channels.
    Mean(RgbTextureId),
    /// 0 where a scalar texture is 0, and 1 elsewhere.
    NotZero(FloatTextureId),
}

/// An image on a surface. (s, t) runs over [0, 1]² from the image's top left.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    pub image: ImageId,
    pub mapping: Mapping,
    pub wrap: Wrap,
    /// Factor of the image's values.
    pub scale: f32,
    /// Take 1 − value, after scaling, and not below 0.
    pub invert: bool,
}

/// What textures are made of.
pub trait TextureValue: Copy + Add<Output = Self> + Mul<Output = Self> + Mul<f32, Output = Self> {
    type Id: Copy + std::fmt::Debug;

    fn splat(value: f32) -> Self;
    /// The colour, or the mean of its channels.
    fn of_colour(colour: Vec3) -> Self;
    fn not_below_zero(self) -> Self;
    /// The image's value at a texel that exists.
    fn texel(image: &TextureImage, x: usize, y: usize) -> Self;
    fn id(index: u32) -> Self::Id;
    fn texture(textures: &Textures, id: Self::Id) -> &Texture<Self>;
    fn pool(textures: &mut Textures) -> &mut Vec<Texture<Self>>;
}

impl TextureValue for f32 {
    type Id = FloatTextureId;

    fn splat(value: f32) -> Self {
        value
    }
    fn of_colour(colour: Vec3) -> Self {
        colour.element_sum() / 3.0
    }
    fn not_below_zero(self) -> Self {
        self.max(0.0)
    }
    fn texel(image: &TextureImage, x: usize, y: usize) -> Self {
        image.float(x, y)
    }
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

impl TextureValue for Vec3 {
    type Id = RgbTextureId;

    fn splat(value: f32) -> Self {
        Vec3::splat(value)
    }
    fn of_colour(colour: Vec3) -> Self {
        colour
    }
    fn not_below_zero(self) -> Self {
        self.max(Vec3::ZERO)
    }
    fn texel(image: &TextureImage, x: usize, y: usize) -> Self {
        image.rgb(x, y)
    }
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

/// The pools.
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

    /// Value of a colour texture, linear RGB.
    #[inline]
    pub fn rgb(&self, id: RgbTextureId, at: TexturePoint) -> Vec3 {
        self.value::<Vec3>(id, at)
    }

    /// `Some` if the texture has the same value everywhere.
    pub fn constant_float(&self, id: FloatTextureId) -> Option<f32> {
        self.constant::<f32>(id)
    }

    /// `Some` if the texture has the same value everywhere.
    pub fn constant_rgb(&self, id: RgbTextureId) -> Option<Vec3> {
        self.constant::<Vec3>(id)
    }

    /// The images of the pool.
    pub fn images(&self) -> &[Arc<TextureImage>] {
        &self.images
    }

    /// An image of the pool.
    pub fn image(&self, id: ImageId) -> &TextureImage {
        &self.images[id.0 as usize]
    }

    /// An image of the pool, for who keeps it.
    pub fn shared_image(&self, id: ImageId) -> Arc<TextureImage> {
        self.images[id.0 as usize].clone()
    }

    /// Adds a texture. The textures that it refers to must be of this pool.
    pub fn add<V: TextureValue>(&mut self, texture: Texture<V>) -> V::Id {
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

    fn constant<V: TextureValue>(&self, id: V::Id) -> Option<V> {
        match V::texture(self, id) {
            Texture::Constant(value) => Some(*value),
            _ => None,
        }
    }

    /// The texture as a constant, if all that it is made of is constant.
    fn folded<V: TextureValue>(&self, texture: Texture<V>) -> Texture<V> {
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
    fn value<V: TextureValue>(&self, id: V::Id, at: TexturePoint) -> V {
        match V::texture(self, id) {
            Texture::Constant(value) => *value,
            varied => self.varied_value(varied, at),
        }
    }

    /// The value of a texture that is not everywhere the same.
    fn varied_value<V: TextureValue>(&self, texture: &Texture<V>, at: TexturePoint) -> V {
        match texture {
            Texture::Constant(value) => *value,
            Texture::Image(texture) => self.image_value(texture, at),
            Texture::Checkerboard { mapping, even, odd } => {
                let cell = mapping.coordinates(at).floor();
                let half = 0.5 * (cell.x + cell.y + cell.z);
                let is_even = half == half.floor();
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

    fn image_value<V: TextureValue>(&self, texture: &ImageTexture, at: TexturePoint) -> V {
        let st = texture.mapping.coordinates(at).truncate();
        let value = self.image(texture.image).bilinear::<V>(st, texture.wrap) * texture.scale;
        if texture.invert { (V::splat(1.0) + value * -1.0).not_below_zero() } else { value }
    }
}

/// Relative luminance of linear sRGB.
pub fn luminance(colour: Vec3) -> f32 {
    colour.dot(Vec3::new(0.2126, 0.7152, 0.0722))
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
    fn what_is_made_of_constants_is_a_constant() {
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
        let mapping = Mapping::Uv { scale: Vec2::new(2.0, 2.0), offset: Vec2::ZERO };
        let board = textures.add(Texture::<f32>::Checkerboard { mapping, even, odd });
        assert_eq!(textures.constant_float(board), None);
        let values = [(0.1, 0.1), (0.6, 0.1), (0.6, 0.6), (-0.1, 0.1), (-0.1, -0.1)]
            .map(|(u, v)| textures.float(board, at(u, v)));
        assert_eq!(values, [1.0, 0.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn angles_around_the_texture_are_shares_of_their_ranges() {
        let to_texture = Affine3A::from_translation(Vec3::new(0.0, 0.0, -1.0));
        let at = |mapping: Mapping, x: f32, y: f32, z: f32| {
            let position = Vec3::new(x, y, z);
            mapping.coordinates(TexturePoint { uv: Vec2::ZERO, position }).truncate()
        };
        let sphere = |flip| Mapping::Spherical { to_texture, flip };
        let cylinder = |flip| Mapping::Cylindrical { to_texture, flip };
        assert_eq!(at(sphere(false), 2.0, 0.0, 1.0), Vec2::new(0.5, 0.0));
        assert_eq!(at(sphere(false), 0.0, -2.0, 1.0), Vec2::new(0.5, 0.75));
        assert_eq!(at(sphere(true), 0.0, 0.1, 1.0), Vec2::new(0.5, 0.75));
        assert_eq!(at(sphere(false), 0.0, 0.0, 4.0).x, 0.0);
        assert_eq!(at(cylinder(false), 3.0, 0.0, 1.25), Vec2::new(0.5, 0.25));
        assert_eq!(at(cylinder(true), 0.0, 3.0, 1.25), Vec2::new(0.75, 0.75));
    }

    #[test]
    fn dots_are_one_texture_on_another_and_corners_are_met() {
        let mut textures = Textures::default();
        let [inside, outside] = [1.0, 0.0].map(|value| textures.add(Texture::Constant(value)));
        let mapping = Mapping::Uv { scale: Vec2::splat(20.0), offset: Vec2::ZERO };
        let dots = textures.add(Texture::<f32>::Dots { mapping, inside, outside });
        let n = 200;
        let values: Vec<f32> = (0..n * n)
            .map(|i| textures.float(dots, at((i % n) as f32 / n as f32, (i / n) as f32 / n as f32)))
            .collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        assert!(values.iter().all(|v| *v == 0.0 || *v == 1.0) && mean > 0.1 && mean < 0.35, "{mean}");

        let mapping = Mapping::Uv { scale: Vec2::ONE, offset: Vec2::ZERO };
        let plane = textures.add(Texture::<f32>::Bilinear { mapping, corners: [1.0, 2.0, 4.0, 8.0] });
        let found = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.5)];
        assert_eq!(found.map(|(u, v)| textures.float(plane, at(u, v))), [1.0, 2.0, 4.0, 8.0, 3.75]);
    }

    #[test]
    fn an_inverted_and_scaled_image_stays_above_zero() {
        let mut textures = Textures::default();
        let image = textures.add_image(TextureImage::from_floats(2, 1, 1, vec![0.25, 4.0]));
        let mapping = Mapping::Uv { scale: Vec2::ONE, offset: Vec2::ZERO };
        let texture = ImageTexture { image, mapping, wrap: Wrap::Clamp, scale: 2.0, invert: true };
        let id = textures.add(Texture::<f32>::Image(texture));
        assert_eq!(textures.float(id, at(0.25, 0.5)), 0.5);
        assert_eq!(textures.float(id, at(0.75, 0.5)), 0.0);
    }
}
