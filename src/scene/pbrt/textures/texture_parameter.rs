//! Parameters that are a value or the name of a texture.

use glam::Vec3;

use crate::scene::pbrt::builder::{NamedTextures, SceneBuilder, TextureSize, TexturesByName};
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::parser::{ParameterDictionary, ParameterType, Result};
use crate::scene::texture::{Content, FloatTextureId, PooledValue, RgbTextureId, Texture};

/// A texture value that can be given as a parameter.
pub trait TextureParameter: PooledValue {
    /// The texture type's name in a scene file, for messages.
    const KIND: &'static str;
    /// What an image is read as.
    fn content(dialect: Dialect) -> Content;
    /// The named textures of this type.
    fn names(names: &mut NamedTextures) -> &mut TexturesByName<Self::Id>;
    /// The value of a parameter that is not a texture, or `default`.
    fn value(
        builder: &mut SceneBuilder,
        params: &ParameterDictionary,
        name: &str,
        default: Self,
    ) -> Result<Self>;
}

impl TextureParameter for f32 {
    const KIND: &'static str = "float";
    fn content(dialect: Dialect) -> Content {
        dialect.scalar_content()
    }
    fn names(names: &mut NamedTextures) -> &mut TexturesByName<FloatTextureId> {
        &mut names.floats
    }
    fn value(_: &mut SceneBuilder, params: &ParameterDictionary, name: &str, default: f32) -> Result<f32> {
        Ok(params.float(name)?.map_or(default, |value| value as f32))
    }
}

impl TextureParameter for Vec3 {
    const KIND: &'static str = "spectrum";
    fn content(_: Dialect) -> Content {
        Content::Colour
    }
    fn names(names: &mut NamedTextures) -> &mut TexturesByName<RgbTextureId> {
        &mut names.rgbs
    }
    fn value(
        builder: &mut SceneBuilder,
        params: &ParameterDictionary,
        name: &str,
        default: Vec3,
    ) -> Result<Vec3> {
        let spectrum = builder.spectrum(params, name)?;
        Ok(spectrum.map_or(default, |spectrum| builder.dialect.reflectance(&spectrum)))
    }
}

impl SceneBuilder {
    /// A float or float texture.
    pub fn float_texture_or(
        &mut self,
        params: &ParameterDictionary,
        name: &str,
        default: f64,
    ) -> Result<FloatTextureId> {
        self.texture_or::<f32>(params, name, default as f32)
    }

    /// A spectrum or spectrum texture.
    pub fn rgb_texture_or(
        &mut self,
        params: &ParameterDictionary,
        name: &str,
        default: Vec3,
    ) -> Result<RgbTextureId> {
        self.texture_or::<Vec3>(params, name, default)
    }

    /// The texture that a parameter names, or a constant texture of its value. In the older dialects an unknown name
    /// stands for `default`.
    pub fn texture_or<V: TextureParameter>(
        &mut self,
        params: &ParameterDictionary,
        name: &str,
        default: V,
    ) -> Result<V::Id> {
        match params.get(name) {
            Some(param) if param.kind == ParameterType::Texture => {
                let [wanted] = param.strings() else {
                    return Err(
                        param.error(format_args!("a list of {} names", param.strings().len()), "one name")
                    );
                };
                let Some(&(id, TextureSize { depth, evaluations })) =
                    V::names(&mut self.named_textures).get(wanted)
                else {
                    let expected = format!("a {} texture that is defined before", V::KIND);
                    let error = param.error(format_args!("the unknown texture \"{wanted}\""), &expected);
                    self.warn_or_fail(error, "using the default")?;
                    return Ok(self.textures.add(Texture::Constant(default)));
                };
                let size = &mut self.named_textures.size;
                size.depth = size.depth.max(depth + 1);
                size.evaluations += evaluations + 1;
                Ok(id)
            }
            _ => {
                let value = V::value(self, params, name, default)?;
                Ok(self.textures.add(Texture::Constant(value)))
            }
        }
    }
}
