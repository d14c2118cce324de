//! Named textures of a scene.

use std::collections::HashMap;

use crate::scene::texture::{FloatTextureId, RgbTextureId};

/// The size of a texture's expression tree.
#[derive(Clone, Copy, Default)]
pub struct TextureSize {
    pub depth: usize,
    /// Number of textures that are evaluated, those that are met twice counted twice.
    pub evaluations: usize,
}

/// Textures of one type by name.
pub type TexturesByName<Id> = HashMap<String, (Id, TextureSize)>;

/// Textures that `Texture` directives have defined.
#[derive(Default)]
pub struct NamedTextures {
    pub floats: TexturesByName<FloatTextureId>,
    pub rgbs: TexturesByName<RgbTextureId>,
    /// Size of the texture that is being defined.
    pub size: TextureSize,
}
