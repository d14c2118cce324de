//! Named textures of a scene.

use std::collections::HashMap;

use crate::scene::texture::{FloatTextureId, RgbTextureId};

/// Textures of one type by name, each with the depth of its expression tree.
pub type TexturesByName<Id> = HashMap<String, (Id, usize)>;

/// Textures that `Texture` directives have defined.
#[derive(Default)]
pub struct NamedTextures {
    pub floats: TexturesByName<FloatTextureId>,
    pub rgbs: TexturesByName<RgbTextureId>,
    /// Depth of the texture that is being defined.
    pub depth: usize,
}
