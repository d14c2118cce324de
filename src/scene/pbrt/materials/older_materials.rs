//! Material types of pbrt-v2 and v3.
//!
//! They are sums of lobes, with Blinn's microfacets in v2 (exponent 1 / roughness) and GGX in v3. The
//! plastics of both, and v2's `uber` and `translucent`, invert the index of refraction, so that all
//! light beyond the critical angle is reflected. The inversion is kept, because it shows in images.

use glam::Vec3;

use crate::scene::RgbTextureId;
use crate::scene::material::{Additive, Lobe, MaterialKind, Metal, Roughness};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, Result};
use crate::scene::texture::Texture;

/// Index of refraction of plastics.
const PLASTIC_ETA: f32 = 1.5;

impl SceneBuilder {
    /// The scattering model of the material type `kind`; `None` if the type is unknown.
    pub fn older_material(
        &mut self,
        kind: &str,
        params: &ParameterDictionary,
        loc: FileLoc,
    ) -> Result<Option<MaterialKind>> {
        let gray = Vec3::splat;
        Ok(Some(match kind {
            // Diffuse and specular surfaces
            "matte" => {
                let reflectance = self.rgb_texture_or(params, "Kd", gray(0.5))?;
                let sigma = self.float_texture_or(params, "sigma", 0.0)?;
                if self.textures.constant_float(sigma) == Some(0.0) {
                    MaterialKind::Diffuse { reflectance }
                } else {
                    MaterialKind::OrenNayar { reflectance, sigma }
                }
            }
            "mirror" => MaterialKind::Mirror { reflectance: self.rgb_texture_or(params, "Kr", gray(0.9))? },
            "glass" => self.glass(params)?,
            // Conductors
            "metal" => MaterialKind::Conductor {
                metal: self.metal(params, "")?,
                roughness: match self.dialect {
                    Dialect::V2 => self.isotropic_roughness(params, 0.01)?,
                    Dialect::V3 | Dialect::V4 => self.roughness(params, "", 0.01)?,
                },
            },
            "shinymetal" => {
                let message =
                    "material \"shinymetal\" is not supported; using \"metal\" with the reflectance \"Ks\"";
                self.warnings.add(loc, message);
                params.get("Kr");
                MaterialKind::Conductor {
                    metal: Metal::Reflectance(self.rgb_texture_or(params, "Ks", gray(1.0))?),
                    roughness: self.isotropic_roughness(params, 0.1)?,
                }
            }
            // Layered and additive surfaces
            "substrate" => MaterialKind::FresnelBlend {
                diffuse: self.rgb_texture_or(params, "Kd", gray(0.5))?,
                specular: self.rgb_texture_or(params, "Ks", gray(0.5))?,
                roughness: self.anisotropic_roughness(params, 0.1)?,
            },
            "plastic" => {
                let diffuse = [Some(self.rgb_texture_or(params, "Kd", gray(0.25))?), None];
                let colours = [Some(self.rgb_texture_or(params, "Ks", gray(0.25))?), None];
                let roughness = self.isotropic_roughness(params, 0.1)?;
                let gloss = Some(Lobe { colours, eta: 1.0 / PLASTIC_ETA, roughness });
                let inverts_gloss_behind = self.dialect.inverts_gloss_behind();
                let lobes = Additive { diffuse, gloss, inverts_gloss_behind, ..Additive::default() };
                MaterialKind::Additive(Box::new(lobes))
            }
            "uber" => self.uber(params)?,
            "translucent" => self.translucent(params)?,
            _ => return Ok(None),
        }))
    }

    /// `glass`, whose reflection and transmission may be tinted.
    fn glass(&mut self, params: &ParameterDictionary) -> Result<MaterialKind> {
        let eta = self.older_refractive_index(params)?;
        let colours = ["Kr", "Kt"].map(|name| self.rgb_texture_or(params, name, Vec3::ONE));
        let [reflected, transmitted] = colours;
        let colours = [Some(reflected?), Some(transmitted?)];
        let roughness = self.glass_roughness(params)?;
        let white =
            |id: &Option<RgbTextureId>| id.is_none_or(|id| self.textures.constant_rgb(id) == Some(Vec3::ONE));
        if colours.iter().all(white) {
            return Ok(MaterialKind::Dielectric { eta, roughness });
        }
        let dielectric = Some(Lobe { colours, eta, roughness });
        Ok(MaterialKind::Additive(Box::new(Additive { dielectric, ..Additive::default() })))
    }

    /// The roughness of `glass`: v2 has none. In v3 glass whose roughness is 0 is smooth, unlike all its other materials.
    fn glass_roughness(&mut self, params: &ParameterDictionary) -> Result<Roughness> {
        if self.dialect == Dialect::V2 {
            return Ok(self.zero_roughness());
        }
        let roughness = self.anisotropic_roughness(params, 0.0)?;
        let is_zero = |id| self.textures.constant_float(id) == Some(0.0);
        let is_smooth = is_zero(roughness.u) && is_zero(roughness.v);
        Ok(if is_smooth { self.zero_roughness() } else { roughness })
    }

    /// `uber`.
    fn uber(&mut self, params: &ParameterDictionary) -> Result<MaterialKind> {
        let eta = match self.dialect {
            Dialect::V2 => self.older_refractive_index(params)?.recip(),
            Dialect::V3 | Dialect::V4 => self.older_refractive_index(params)?,
        };
        let mut colour = |name, default| self.rgb_texture_or(params, name, Vec3::splat(default)).map(Some);
        let diffuse = [colour("Kd", 0.25)?, None];
        let gloss = [colour("Ks", 0.25)?, None];
        let boundary = [colour("Kr", 0.0)?, colour("Kt", 0.0)?];
        let opacity = colour("opacity", 1.0)?;
        let roughness = match self.dialect {
            Dialect::V2 => self.isotropic_roughness(params, 0.1)?,
            Dialect::V3 | Dialect::V4 => self.uber_roughness(params)?,
        };
        let gloss = Some(Lobe { colours: gloss, eta, roughness });
        let dielectric = Some(Lobe { colours: boundary, eta, roughness: self.zero_roughness() });
        let inverts_gloss_behind = self.dialect.inverts_gloss_behind();
        let lobes = Additive { diffuse, gloss, inverts_gloss_behind, dielectric, opacity };
        Ok(MaterialKind::Additive(Box::new(lobes)))
    }

    /// The roughness of `uber` in v3, whose `vroughness` is `uroughness` by default.
    fn uber_roughness(&mut self, params: &ParameterDictionary) -> Result<Roughness> {
        let roughness = self.roughness(params, "", 0.1)?;
        let v = if params.get("vroughness").is_some() { roughness.v } else { roughness.u };
        Ok(Roughness { v, ..roughness })
    }

    /// `translucent`.
    fn translucent(&mut self, params: &ParameterDictionary) -> Result<MaterialKind> {
        let half = Vec3::splat(0.5);
        let sides = ["reflect", "transmit"].map(|name| self.rgb_texture_or(params, name, half));
        let [reflect, transmit] = sides;
        let sides = [reflect?, transmit?];
        let mut colours = |name| -> Result<[Option<RgbTextureId>; 2]> {
            let first = self.rgb_texture_or(params, name, Vec3::splat(0.25))?;
            Ok(sides.map(|second| Some(self.textures.add(Texture::<Vec3>::Product { first, second }))))
        };
        let (diffuse, colours) = (colours("Kd")?, colours("Ks")?);
        let roughness = self.isotropic_roughness(params, 0.1)?;
        let layer = |eta| Some(Lobe { colours, eta, roughness });
        // v2 mirrors its glossy lobe below the surface; v3 uses rough glass
        let (gloss, dielectric) = match self.dialect {
            Dialect::V2 => (layer(1.0 / PLASTIC_ETA), None),
            Dialect::V3 | Dialect::V4 => (None, layer(PLASTIC_ETA)),
        };
        Ok(MaterialKind::Additive(Box::new(Additive { diffuse, gloss, dielectric, ..Additive::default() })))
    }

    /// The index of refraction, named `eta` or `index`.
    fn older_refractive_index(&mut self, params: &ParameterDictionary) -> Result<f32> {
        let name = if params.get("eta").is_some() { "eta" } else { "index" };
        self.refractive_index(params, name, f64::from(PLASTIC_ETA))
    }
}
