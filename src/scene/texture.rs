//! Textures: small expression trees over images and constants, stored in pools.

use glam::{Vec2, Vec3};

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

/// The pools.
#[derive(Clone, Debug, Default)]
pub struct Textures {
    // scene helper: floats: Vec<FloatTexture>, rgbs: Vec<RgbTexture>, images: Vec<TextureImage>
}

impl Textures {
    /// Value of a scalar texture.
    pub fn float(&self, id: FloatTextureId, at: TexturePoint) -> f32 {
        let _ = (id, at);
        todo!()
    }

    /// Value of a colour texture, linear RGB.
    pub fn rgb(&self, id: RgbTextureId, at: TexturePoint) -> Vec3 {
        let _ = (id, at);
        todo!()
    }

    /// `Some` if the texture has the same value everywhere.
    pub fn constant_float(&self, id: FloatTextureId) -> Option<f32> {
        let _ = id;
        todo!()
    }

    /// `Some` if the texture has the same value everywhere.
    pub fn constant_rgb(&self, id: RgbTextureId) -> Option<Vec3> {
        let _ = id;
        todo!()
    }
}
