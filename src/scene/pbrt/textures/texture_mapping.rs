//! Mappings from surface points to texture coordinates.

use glam::{DAffine3, DMat3, DVec3, Vec2};

use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::directives::transforms::inverse;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result};
use crate::scene::texture::TextureMapping;

impl SceneBuilder {
    /// The 2D mapping of a texture. If `flip` is set, v = 0 maps to the last row of an image.
    pub fn texture_mapping(&mut self, params: &ParameterDictionary, flip: bool) -> Result<TextureMapping> {
        let number = |name, default| -> Result<f32> { Ok(params.float_or(name, default)? as f32) };
        let mut offset = Vec2::new(number("udelta", 0.0)?, number("vdelta", 0.0)?);
        match params.string("mapping")? {
            None | Some("uv") => {}
            Some("planar") => return self.planar_mapping(params, offset, flip),
            Some("spherical") => {
                let to_texture = self.to_texture(params.loc)?.as_affine3a();
                return Ok(TextureMapping::Spherical { to_texture, flip });
            }
            Some("cylindrical") => {
                let to_texture = self.to_texture(params.loc)?.as_affine3a();
                let normalised = self.dialect.normalises_cylindrical_mappings();
                return Ok(TextureMapping::Cylindrical { to_texture, normalised, flip });
            }
            Some(other) => {
                self.warnings
                    .add(params.loc, format!("texture mapping \"{other}\" is not supported; using \"uv\""));
            }
        }
        let mut scale = Vec2::new(number("uscale", 1.0)?, number("vscale", 1.0)?);
        if flip {
            scale.y = -scale.y;
            offset.y = 1.0 - offset.y;
        }
        Ok(TextureMapping::Uv { scale, offset })
    }

    /// The mapping by distances from two planes through the origin of the texture's space.
    fn planar_mapping(
        &self,
        params: &ParameterDictionary,
        offset: Vec2,
        flip: bool,
    ) -> Result<TextureMapping> {
        let v1 = params.triple_or("v1", DVec3::X)?;
        let v2 = params.triple_or("v2", DVec3::Y)?;
        let mut planes = DAffine3 {
            matrix3: DMat3::from_cols(v1, v2, DVec3::ZERO).transpose(),
            translation: offset.as_dvec2().extend(0.0),
        };
        if flip {
            planes = DAffine3::from_translation(DVec3::Y)
                * DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0))
                * planes;
        }
        let space = match self.dialect.applies_ctm_to_world_points() {
            true => self.to_world(),
            false => self.to_texture(params.loc)?,
        };
        Ok(TextureMapping::Space((planes * space).as_affine3a()))
    }

    /// Render space to world space.
    fn to_world(&self) -> DAffine3 {
        DAffine3::from_translation(self.origin())
    }

    /// Render space to the space in which solid textures are evaluated.
    pub fn solid_texture_transform(&self, loc: FileLoc) -> Result<DAffine3> {
        match self.dialect.applies_ctm_to_world_points() {
            true => Ok(self.state.ctm[0] * self.to_world()),
            false => self.to_texture(loc),
        }
    }

    /// Render space to the current space.
    fn to_texture(&self, loc: FileLoc) -> Result<DAffine3> {
        let message = "the current transform is singular; expected an invertible transform";
        inverse(&self.to_render()).ok_or_else(|| ParseError::new(loc, message))
    }
}
