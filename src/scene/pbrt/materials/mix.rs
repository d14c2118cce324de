//! Mixes of two materials.

use glam::Vec3;

use crate::scene::material::MaterialKind;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result};
use crate::scene::texture::Texture;

/// Nesting limit of mixes.
const MAX_MIX_DEPTH: usize = 8;

impl SceneBuilder {
    /// `mix` of two named materials.
    pub fn mix(&mut self, params: &ParameterDictionary, loc: FileLoc) -> Result<MaterialKind> {
        let [first, second] = self.mix_material_names(params, loc)?;
        let (first, second) = (self.find_material(first, loc)?.id, self.find_material(second, loc)?.id);
        if [first, second].iter().any(|id| self.mix_depths[id.0 as usize] >= MAX_MIX_DEPTH) {
            let message = format!("mixes are nested too deep; expected at most {MAX_MIX_DEPTH} levels");
            return Err(ParseError::new(loc, message));
        }
        let amount = if self.dialect.mix_amount_is_spectrum() {
            let colour = self.rgb_texture_or(params, "amount", Vec3::splat(0.5))?;
            let same = |value: Vec3| value == Vec3::splat(value.x);
            if !self.textures.constant_rgb(colour).is_some_and(same) {
                self.warnings.add(loc, "mixing by colour is not supported; using the mean of its channels");
            }
            self.textures.add(Texture::<f32>::Mean(colour))
        } else {
            self.float_texture_or(params, "amount", 0.5)?
        };
        Ok(MaterialKind::Mix { first, second, amount })
    }

    /// The names of the two materials; an `amount` of 0 selects the first.
    fn mix_material_names<'p>(&self, params: &'p ParameterDictionary, loc: FileLoc) -> Result<[&'p str; 2]> {
        if let Some([first, second]) = params.strings("materials")? {
            return Ok([first, second]);
        }
        // The older dialects weight the first by `amount`
        match (params.string("namedmaterial1")?, params.string("namedmaterial2")?) {
            (Some(first), Some(second)) => Ok([second, first]),
            _ => {
                let message = "mix without \"string materials\"; expected the names of two materials";
                Err(ParseError::new(loc, message))
            }
        }
    }
}
