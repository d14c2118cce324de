//! Values of textures: `f32` and linear RGB.

use std::fmt::Debug;
use std::ops::{Add, Mul};

use glam::Vec3;

use super::texture_id::{FloatTextureId, RgbTextureId};

/// A value of a texture.
pub trait TextureValue: Copy + Add<Output = Self> + Mul<Output = Self> + Mul<f32, Output = Self> {
    /// Index of a texture with values of this type.
    type Id: Copy + Debug + 'static;

    /// The value with all channels equal.
    fn splat(value: f32) -> Self;
    /// The colour, or the mean of its channels.
    fn from_rgb(colour: Vec3) -> Self;
    /// The value with negative channels clamped to 0.
    fn clamp_zero(self) -> Self;
}

impl TextureValue for f32 {
    type Id = FloatTextureId;

    fn splat(value: f32) -> Self {
        value
    }
    fn from_rgb(colour: Vec3) -> Self {
        colour.element_sum() / 3.0
    }
    fn clamp_zero(self) -> Self {
        self.max(0.0)
    }
}

impl TextureValue for Vec3 {
    type Id = RgbTextureId;

    fn splat(value: f32) -> Self {
        Vec3::splat(value)
    }
    fn from_rgb(colour: Vec3) -> Self {
        colour
    }
    fn clamp_zero(self) -> Self {
        self.max(Vec3::ZERO)
    }
}
