//! Parameters that several materials share: conductors, roughness, index of refraction.

use glam::Vec3;

use crate::scene::material::{Metal, Roughness, RoughnessScale};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::parser::{ParameterDictionary, ParameterType, Result};
use crate::scene::pbrt::spectrum::Spectrum;
use crate::scene::texture::{FloatTextureId, Texture};

impl SceneBuilder {
    /// A conductor from `eta` and `k`, or from `reflectance`; copper by default.
    pub fn metal(&mut self, params: &ParameterDictionary, prefix: &str) -> Result<Metal> {
        // The table is of v4's values, which are relative to white
        let white = self.dialect.reflectance(&Spectrum::constant(1.0));
        let named =
            |name: &str| Spectrum::named(name).map_or(Vec3::ZERO, |spectrum| spectrum.reflectance() * white);
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
        let name = format!("{prefix}roughness");
        let common = self.float_texture_or(params, &name, default)?;
        self.warn_of_negative(params, &name);
        let along = [Some("u"), Some("v")];
        self.roughness_along(params, prefix, along, common)
    }

    /// `roughness` alone, of materials of the older dialects.
    pub fn isotropic_roughness(&mut self, params: &ParameterDictionary, default: f64) -> Result<Roughness> {
        let common = self.float_texture_or(params, "roughness", default)?;
        self.warn_of_negative(params, "roughness");
        self.roughness_along(params, "", [None; 2], common)
    }

    /// `uroughness` and `vroughness` alone, of materials of the older dialects.
    pub fn anisotropic_roughness(&mut self, params: &ParameterDictionary, default: f64) -> Result<Roughness> {
        let common = self.textures.add(Texture::Constant(default as f32));
        self.roughness_along(params, "", [Some("u"), Some("v")], common)
    }

    /// The roughness along axes whose parameters are read; along others, and by default, it is `common`.
    fn roughness_along(
        &mut self,
        params: &ParameterDictionary,
        prefix: &str,
        axes: [Option<&str>; 2],
        common: FloatTextureId,
    ) -> Result<Roughness> {
        let [u, v] = axes.map(|axis| {
            let name = format!("{prefix}{}roughness", axis?);
            self.warn_of_negative(params, &name);
            params.get(&name).map(|_| self.float_texture_or(params, &name, 0.0))
        });
        let (u, v) = (u.unwrap_or(Ok(common))?, v.unwrap_or(Ok(common))?);
        let remap = params.bool_or("remaproughness", true)?;
        Ok(Roughness { u, v, scale: self.dialect.roughness_scale(remap) })
    }

    /// Warns of a number below 0.
    fn warn_of_negative(&mut self, params: &ParameterDictionary, name: &str) {
        if let Ok(Some(value)) = params.float(name)
            && value < 0.0
        {
            let message = format!("\"{name}\" is {value}; expected a number from 0 up");
            self.warnings.add(params.loc, message);
        }
    }

    /// The roughness of a perfectly smooth surface.
    pub fn zero_roughness(&mut self) -> Roughness {
        let zero = self.textures.add(Texture::Constant(0.0));
        Roughness { u: zero, v: zero, scale: RoughnessScale::Alpha }
    }

    /// An index of refraction: a number, or a spectrum evaluated at the d line. In the older dialects it may be a texture, of which
    /// constant ones are supported.
    pub fn refractive_index(
        &mut self,
        params: &ParameterDictionary,
        name: &str,
        default: f64,
    ) -> Result<f32> {
        let Some(param) = params.get(name) else { return Ok(default as f32) };
        let eta = match param.kind {
            ParameterType::Float | ParameterType::Integer => params.float_or(name, default)?,
            ParameterType::Texture if self.dialect != Dialect::V4 => {
                let texture = self.float_texture_or(params, name, default)?;
                let constant = self.textures.constant_float(texture).map(f64::from);
                if constant.is_none() {
                    let message = format!("textures of \"{name}\" are not supported; using {default}");
                    self.warnings.add(param.loc, message);
                }
                constant.unwrap_or(default)
            }
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
