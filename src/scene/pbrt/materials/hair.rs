//! Hair, approximated by a diffuse surface of the colour of much hair.
//!
//! Absorption of the pigments: pbrt-v4, section 9.9. Colour by absorption: the fit of Chiang et al.,
//! "A practical and controllable hair and fur model for production path tracing", 2016.

use glam::Vec3;

use crate::scene::material::MaterialKind;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParameterType, Result};
use crate::scene::texture::Texture;

/// Absorption of the pigments by channel, for a concentration of 1.
const EUMELANIN: Vec3 = Vec3::new(0.419, 0.697, 1.37);
const PHEOMELANIN: Vec3 = Vec3::new(0.187, 0.4, 1.05);
/// Eumelanin concentration of hair without colour parameters: brown.
const DEFAULT_EUMELANIN: f64 = 1.3;

/// Colour of a volume of hair, from its absorption and azimuthal roughness.
fn hair_colour(absorption: Vec3, roughness: f32) -> Vec3 {
    let coefficients = [5.969, -0.215, 2.532, -10.73, 5.574, 0.245];
    let fit = coefficients.iter().rev().fold(0.0, |sum, c| sum * roughness + c);
    absorption.map(|a| (-a.max(0.0).sqrt() * fit).exp().min(1.0))
}

impl SceneBuilder {
    /// `hair` as a diffuse material.
    pub fn hair(&mut self, params: &ParameterDictionary, loc: FileLoc) -> Result<MaterialKind> {
        self.warnings
            .add(loc, "material \"hair\" is not supported; using \"diffuse\" with the hair's colour");
        for name in ["eta", "beta_m", "alpha"] {
            params.get(name);
        }
        let number = |name, default: f64| match params.get(name) {
            Some(param) if param.kind == ParameterType::Texture => Ok(default),
            _ => params.float_or(name, default),
        };
        let roughness = number("beta_n", 0.3)?;

        // Read or compute the absorption
        let absorption = match params.get("sigma_a").map(|param| param.kind) {
            Some(kind) if kind != ParameterType::Texture => {
                self.spectrum(params, "sigma_a")?.map(|s| s.unadapted())
            }
            _ => None,
        };
        let named = ["reflectance", "color"].into_iter().find(|name| params.get(name).is_some());
        let reflectance = match (absorption, named) {
            (None, Some(name)) => self.rgb_texture_or(params, name, Vec3::splat(0.5))?,
            (absorption, _) => {
                let is_dyed = ["eumelanin", "pheomelanin"].iter().any(|name| params.get(name).is_some());
                let brown = if is_dyed { 0.0 } else { DEFAULT_EUMELANIN };
                let pigments = number("eumelanin", brown)? as f32 * EUMELANIN
                    + number("pheomelanin", 0.0)? as f32 * PHEOMELANIN;
                let colour = hair_colour(absorption.unwrap_or(pigments), roughness as f32);
                self.textures.add(Texture::Constant(colour))
            }
        };
        Ok(MaterialKind::Diffuse { reflectance })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::pbrt::read_str;

    #[test]
    fn hair_is_diffuse_with_a_warning() {
        let colour = |params: &str| {
            let scene = read_str(&format!("WorldBegin Material \"hair\" {params}"), Path::new("")).unwrap();
            assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
            assert!(scene.warnings[0].starts_with("<text>:1:") && scene.warnings[0].contains("\"hair\""));
            let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
            scene.textures.constant_rgb(reflectance).unwrap()
        };
        assert_eq!(colour("\"rgb color\" [.3 .2 .1] \"float beta_n\" .2"), Vec3::new(0.3, 0.2, 0.1));
        let brown = colour("\"float beta_m\" .4");
        assert!(brown.x > 2.0 * brown.z && brown.x < 0.2, "{brown}");
        assert_eq!(colour("\"float eumelanin\" 1.3"), brown);
        assert_eq!(colour("\"rgb sigma_a\" [0 0 0] \"float eumelanin\" 8"), Vec3::ONE);
        assert!(colour("\"float eumelanin\" 8").max_element() < 0.01);
    }
}
