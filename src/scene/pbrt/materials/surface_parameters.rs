//! Parameters that several materials share: conductors, roughness, index of refraction.

use glam::Vec3;

use crate::scene::material::{Metal, Roughness, RoughnessScale};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, ParameterType, Result};
use crate::scene::pbrt::spectrum::Spectrum;
use crate::scene::texture::{FloatTextureId, Texture};

impl SceneBuilder {
    /// A conductor from `eta` and `k`, or from `reflectance`; copper by default.
    pub fn metal(&mut self, params: &ParameterDictionary, prefix: &str) -> Result<Metal> {
        let named = |name: &str| Spectrum::named(name).map_or(Vec3::ZERO, |spectrum| spectrum.reflectance());
        if params.get("reflectance").is_some() {
            return Ok(Metal::Reflectance(self.rgb_texture_or(params, "reflectance", Vec3::ONE)?));
        }
        Ok(Metal::Fresnel {
            eta: self.rgb_texture_or(params, &format!("{prefix}eta"), named("metal-Cu-eta"))?,
            k: self.rgb_texture_or(params, &format!("{prefix}k"), named("metal-Cu-k"))?,
        })
    }

    /// `uroughness` and `vroughness`, which default to `roughness`.
    pub fn roughness(
        &mut self,
        params: &ParameterDictionary,
        prefix: &str,
        default: f64,
    ) -> Result<Roughness> {
        let common = self.float_texture_or(params, &format!("{prefix}roughness"), default)?;
        for name in ["roughness", "uroughness", "vroughness"].map(|name| format!("{prefix}{name}")) {
            if let Ok(Some(value)) = params.float(&name)
                && value < 0.0
            {
                let message = format!("\"{name}\" is {value}; expected a number from 0 up");
                self.warnings.add(params.loc, message);
            }
        }
        let mut along = |axis: &str| -> Result<FloatTextureId> {
            let name = format!("{prefix}{axis}roughness");
            if params.get(&name).is_some() {
                self.float_texture_or(params, &name, default)
            } else {
                Ok(common)
            }
        };
        let (u, v) = (along("u")?, along("v")?);
        let remap = params.bool_or("remaproughness", true)?;
        Ok(Roughness { u, v, scale: self.dialect.roughness_scale(remap) })
    }

    /// The roughness of a perfectly smooth surface.
    pub fn zero_roughness(&mut self) -> Roughness {
        let zero = self.textures.add(Texture::Constant(0.0));
        Roughness { u: zero, v: zero, scale: RoughnessScale::Alpha }
    }

    /// An index of refraction: a number, or a spectrum evaluated at the d line.
    pub fn refractive_index(
        &mut self,
        params: &ParameterDictionary,
        name: &str,
        default: f64,
    ) -> Result<f32> {
        let Some(param) = params.get(name) else { return Ok(default as f32) };
        let eta = match param.kind {
            ParameterType::Float | ParameterType::Integer => params.float_or(name, default)?,
            _ => {
                self.warnings.add(
                    param.loc,
                    "dispersion is not simulated; using the index of refraction at the d line",
                );
                self.spectrum(params, name)?.map_or(default, |spectrum| spectrum.refractive_index())
            }
        };
        let single = eta as f32;
        if single > 0.0 && single.is_finite() {
            return Ok(single);
        }
        Err(param.error(eta, "an index of refraction above 0"))
    }
}
