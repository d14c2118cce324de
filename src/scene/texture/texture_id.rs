//! Indices of textures and images.

/// Index of a scalar texture in [`super::Textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FloatTextureId(pub u32);

/// Index of an RGB texture in [`super::Textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RgbTextureId(pub u32);

/// Index of an image in [`super::Textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageId(pub u32);
