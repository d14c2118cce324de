//! Mixes of two materials.

use glam::Vec3;

use crate::scene::MaterialId;
use crate::scene::material::MaterialKind;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result};
use crate::scene::texture::Texture;

/// Nesting limit of mixes.
const MAX_MIX_DEPTH: usize = 8;
/// The material that is added before all others.
const DEFAULT_MATERIAL: MaterialId = MaterialId(0);

fn too_deep(loc: FileLoc) -> ParseError {
    let expected = format!("expected at most {MAX_MIX_DEPTH} levels, none of which contains itself");
    ParseError::new(loc, format!("mixes are nested too deep; {expected}"))
}

impl SceneBuilder {
    /// `mix` of two named materials.
    pub fn mix(&mut self, params: &ParameterDictionary, loc: FileLoc) -> Result<MaterialKind> {
        let [first, second] = self.mix_material_names(params, loc)?;
        let (first, second) = (self.part_of_mix(first, loc)?, self.part_of_mix(second, loc)?);
        if [first, second].iter().any(|id| self.mix_depths[id.0 as usize] >= MAX_MIX_DEPTH) {
            return Err(too_deep(loc));
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

    /// A named material as a part of a mix. In v4 it may be defined later; in the older dialects the default material
    /// takes its place if it is not defined.
    fn part_of_mix(&mut self, name: &str, loc: FileLoc) -> Result<MaterialId> {
        match self.find_material(name, loc) {
            Ok(material) => Ok(material.id),
            Err(_) if self.dialect.allows_forward_references() => {
                self.forward_mix.get_or_insert(loc);
                Ok(self.declare_material(name, loc).id)
            }
            Err(error) => {
                self.warn_or_fail(error, "using \"matte\"")?;
                Ok(DEFAULT_MATERIAL)
            }
        }
    }

    /// Checks the nesting of mixes once all materials are defined.
    ///
    /// # Errors
    /// Located at the first mix that names a later material, if mixes are nested too deep or contain
    /// themselves.
    pub fn check_forward_mixes(&self) -> Result<()> {
        let Some(loc) = self.forward_mix else { return Ok(()) };
        let mut ids = (0..self.materials.len() as u32).map(MaterialId);
        if ids.all(|id| self.is_nested_at_most(id, MAX_MIX_DEPTH)) { Ok(()) } else { Err(too_deep(loc)) }
    }

    /// Whether a material is at most this many mixes within each other.
    fn is_nested_at_most(&self, id: MaterialId, levels: usize) -> bool {
        match self.materials[id.0 as usize].kind {
            MaterialKind::Mix { first, second, .. } => {
                levels > 0 && [first, second].iter().all(|&part| self.is_nested_at_most(part, levels - 1))
            }
            _ => true,
        }
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
