//! Material types of pbrt-v4.

use glam::Vec3;

use crate::scene::material::{MaterialKind, Metal};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result};
use crate::scene::texture::Texture;

/// Default index of refraction.
const DEFAULT_ETA: f64 = 1.5;
/// Of coatings.
const DEFAULT_THICKNESS: f64 = 0.01;

impl SceneBuilder {
    /// The scattering model of the material type `kind`; of an unknown type `matte` in the older dialects.
    pub fn material_kind(
        &mut self,
        kind: &str,
        params: &ParameterDictionary,
        loc: FileLoc,
    ) -> Result<MaterialKind> {
        Ok(match kind {
            // Diffuse surfaces
            "diffuse" => MaterialKind::Diffuse {
                reflectance: self.rgb_texture_or(params, "reflectance", Vec3::splat(0.5))?,
            },
            "diffusetransmission" => {
                let quarter = Vec3::splat(0.25);
                let factor = params.float_or("scale", 1.0)? as f32;
                let factor = self.textures.add(Texture::Constant(Vec3::splat(factor)));
                let [reflectance, transmittance] = ["reflectance", "transmittance"].map(|name| {
                    let first = self.rgb_texture_or(params, name, quarter)?;
                    Ok(self.textures.add(Texture::<Vec3>::Product { first, second: factor }))
                });
                MaterialKind::DiffuseTransmission { reflectance: reflectance?, transmittance: transmittance? }
            }
            // Conductors and dielectrics
            "conductor" => MaterialKind::Conductor {
                metal: self.metal(params, "")?,
                roughness: self.roughness(params, "", 0.0)?,
            },
            "dielectric" => MaterialKind::Dielectric {
                eta: self.refractive_index(params, "eta", DEFAULT_ETA)?,
                roughness: self.roughness(params, "", 0.0)?,
            },
            "thindielectric" => {
                MaterialKind::ThinDielectric { eta: self.refractive_index(params, "eta", DEFAULT_ETA)? }
            }
            // Layered surfaces
            "coateddiffuse" => {
                self.ignore_coating_medium(params, loc)?;
                MaterialKind::CoatedDiffuse {
                    reflectance: self.rgb_texture_or(params, "reflectance", Vec3::splat(0.5))?,
                    eta: self.refractive_index(params, "eta", DEFAULT_ETA)?,
                    roughness: self.roughness(params, "", 0.0)?,
                    thickness: self.float_texture_or(params, "thickness", DEFAULT_THICKNESS)?,
                }
            }
            "coatedconductor" => {
                self.ignore_coating_medium(params, loc)?;
                MaterialKind::CoatedConductor {
                    metal: self.metal(params, "conductor.")?,
                    conductor_roughness: self.roughness(params, "conductor.", 0.0)?,
                    eta: self.refractive_index(params, "interface.eta", DEFAULT_ETA)?,
                    interface_roughness: self.roughness(params, "interface.", 0.0)?,
                    thickness: self.float_texture_or(params, "thickness", DEFAULT_THICKNESS)?,
                }
            }
            // Materials in files of their own
            "mix" => self.mix(params, loc)?,
            "interface" | "" | "none" => MaterialKind::Interface,
            "measured" => self.measured(params, loc)?,
            "hair" => self.hair(params, loc)?,
            // Unsupported materials become diffuse
            "subsurface" | "kdsubsurface" | "disney" | "fourier" => {
                self.warnings.add(loc, format!("material \"{kind}\" is not supported; using \"diffuse\""));
                let named =
                    ["color", "Kd", "reflectance"].into_iter().find(|name| params.get(name).is_some());
                params.mark_all_used();
                let name = named.unwrap_or("reflectance");
                MaterialKind::Diffuse { reflectance: self.rgb_texture_or(params, name, Vec3::splat(0.5))? }
            }
            // Materials of the older dialects
            other => match self.older_material(other, params, loc)? {
                Some(kind) => kind,
                None => {
                    let expected = self.dialect.material_names();
                    let message = format!("unknown material \"{other}\"; expected {expected}");
                    self.warn_or_fail(ParseError::new(loc, message), "using \"matte\"")?;
                    self.material_kind("matte", params, loc)?
                }
            },
        })
    }

    /// Marks the parameters of scattering in a coating's medium as used; only its absorption is simulated.
    fn ignore_coating_medium(&mut self, params: &ParameterDictionary, loc: FileLoc) -> Result<()> {
        if params.get("albedo").is_some() {
            self.warnings.add(
                loc,
                "scattering inside a coating (\"albedo\", \"g\") is not simulated, only absorption",
            );
        }
        for name in ["g", "maxdepth", "nsamples"] {
            params.get(name);
        }
        Ok(())
    }

    /// Warns about constant reflectances above 1, which the renderer clamps.
    pub fn warn_reflectance_above_one(&mut self, name: &str, kind: &MaterialKind, loc: FileLoc) {
        /// Rounding error of white after conversion between colour spaces.
        const ROUNDING: f32 = 1e-3;
        let reflectances = match kind {
            MaterialKind::Diffuse { reflectance } | MaterialKind::CoatedDiffuse { reflectance, .. } => {
                vec![*reflectance]
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                vec![*reflectance, *transmittance]
            }
            MaterialKind::Conductor { metal: Metal::Reflectance(reflectance), .. }
            | MaterialKind::CoatedConductor { metal: Metal::Reflectance(reflectance), .. } => {
                vec![*reflectance]
            }
            _ => Vec::new(),
        };
        for id in reflectances {
            if let Some(value) = self.textures.constant_rgb(id).filter(|v| v.max_element() > 1.0 + ROUNDING) {
                let suffix = if name.is_empty() { String::new() } else { format!(" of material \"{name}\"") };
                let [r, g, b] = value.to_array();
                let message = format!("reflectance {r} {g} {b}{suffix} is clamped to 1");
                self.warnings.add(loc, message);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::material::RoughnessScale;
    use crate::scene::pbrt::read_str;

    #[test]
    fn materials_have_their_parameters_and_defaults() {
        let scene = read_str(
        "WorldBegin Texture \"half\" \"float\" \"constant\" \"float value\" .5
         Material \"conductor\" \"texture uroughness\" \"half\" \"float roughness\" .25 \"bool remaproughness\" false
         Material \"dielectric\" \"spectrum eta\" \"glass-BK7\"
         MakeNamedMaterial \"a\" \"string type\" \"coateddiffuse\" \"rgb reflectance\" [.1 .2 .3]
         Material \"mix\" \"string materials\" [\"a\" \"a\"] \"float amount\" .3",
        Path::new(""),
    )
    .unwrap();
        let kinds: Vec<_> = scene.materials.iter().skip(1).map(|material| &material.kind).collect();
        let MaterialKind::Conductor { roughness, .. } = kinds[0] else { panic!() };
        let constant = |id| scene.textures.constant_float(id);
        assert_eq!(
            (constant(roughness.u), constant(roughness.v), roughness.scale),
            (Some(0.5), Some(0.25), RoughnessScale::Alpha)
        );
        let MaterialKind::Dielectric { eta, .. } = kinds[1] else { panic!() };
        assert_eq!(*eta, 1.5168);
        let MaterialKind::CoatedDiffuse { reflectance, eta, .. } = kinds[2] else { panic!() };
        assert_eq!(scene.textures.constant_rgb(*reflectance), Some(Vec3::new(0.1, 0.2, 0.3)));
        assert_eq!(*eta, 1.5);
        assert!(matches!(kinds[3], MaterialKind::Mix { .. }));
        assert!(
            scene.warnings.len() == 1 && scene.warnings[0].contains("dispersion"),
            "{:?}",
            scene.warnings
        );
    }
}
