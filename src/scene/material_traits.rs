//! Classifies a material by properties that hold at every point of a surface: the kinds of its lobes, and what its
//! scattering depends on.
//!
//! Takes a material and the scene's textures. The scene's effects, the dimensions of the sampler and the choice of
//! the shading code follow from the result.

use glam::Vec3;

use super::material::{Additive, Material, MaterialKind, Metal, Roughness, RoughnessScale};
use super::texture::{RgbTextureId, Textures};

/// Properties of one material. Those of a mix exclude the mixed materials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaterialTraits {
    /// Some lobe is perfectly specular.
    pub is_specular: bool,
    /// Some lobe is neither Lambertian nor perfectly specular.
    pub is_glossy: bool,
    /// BSDF sampling needs a sample value to choose a lobe.
    pub chooses_lobe: bool,
    /// Texture coordinates or tangents may change the scattering.
    pub needs_parametrisation: bool,
    /// The material is a choice between two others.
    pub is_mix: bool,
    /// Light passes unchanged.
    pub is_interface: bool,
}

impl MaterialTraits {
    pub fn new(textures: &Textures, material: &Material) -> Self {
        let traits = Self::from_kind(textures, &material.kind);
        let is_bumped = material.displacement.is_some() || material.normal_map.is_some();
        Self { needs_parametrisation: traits.needs_parametrisation || is_bumped, ..traits }
    }

    /// The traits without bump and normal maps.
    fn from_kind(textures: &Textures, kind: &MaterialKind) -> Self {
        // The parametrisation counts as needed unless these show that it is not.
        let is_constant = |id: RgbTextureId| textures.constant_rgb(id).is_some();
        let needed = Self { needs_parametrisation: true, ..Self::default() };
        let needed_unless = |is_independent: bool| Self { needs_parametrisation: !is_independent, ..needed };
        match kind {
            // Diffuse materials
            MaterialKind::Diffuse { reflectance } => needed_unless(is_constant(*reflectance)),
            MaterialKind::DiffuseTransmission { .. } => Self { chooses_lobe: true, ..needed },
            MaterialKind::OrenNayar { .. } => Self { is_glossy: true, ..needed },

            // Conductors and dielectrics
            MaterialKind::Mirror { .. } => Self { is_specular: true, ..needed },
            MaterialKind::Conductor { metal, roughness } => {
                needed_unless(metal.is_constant(textures) && roughness.is_isotropic(textures))
                    .with_microfacets(textures, roughness)
            }
            MaterialKind::Dielectric { roughness, .. } => {
                Self { chooses_lobe: true, ..needed_unless(roughness.is_isotropic(textures)) }
                    .with_microfacets(textures, roughness)
            }
            MaterialKind::ThinDielectric { .. } => {
                Self { is_specular: true, chooses_lobe: true, ..needed_unless(true) }
            }

            // Layered and composite materials
            MaterialKind::CoatedDiffuse { reflectance, roughness, thickness, .. } => {
                let is_independent = is_constant(*reflectance)
                    && roughness.is_isotropic(textures)
                    && textures.constant_float(*thickness).is_some();
                Self { chooses_lobe: true, ..needed_unless(is_independent) }
                    .with_microfacets(textures, roughness)
            }
            MaterialKind::CoatedConductor { conductor_roughness, interface_roughness, .. } => {
                Self { chooses_lobe: true, ..needed }
                    .with_microfacets(textures, conductor_roughness)
                    .with_microfacets(textures, interface_roughness)
            }
            MaterialKind::FresnelBlend { .. } | MaterialKind::Measured(_) => {
                Self { is_glossy: true, chooses_lobe: true, ..needed }
            }
            MaterialKind::Additive(lobes) => {
                Self { chooses_lobe: true, ..needed }.with_additive_lobes(textures, lobes)
            }
            MaterialKind::Mix { .. } => Self { is_mix: true, ..needed },

            MaterialKind::Interface => Self { is_interface: true, ..needed_unless(true) },
        }
    }

    /// Adds a microfacet lobe, which is specular if it is smooth and glossy otherwise.
    fn with_microfacets(self, textures: &Textures, roughness: &Roughness) -> Self {
        if roughness.is_smooth(textures) {
            Self { is_specular: true, ..self }
        } else {
            Self { is_glossy: true, ..self }
        }
    }

    fn with_additive_lobes(mut self, textures: &Textures, lobes: &Additive) -> Self {
        let is_black = |id: &RgbTextureId| textures.constant_rgb(*id) == Some(Vec3::ZERO);
        let is_visible = |colours: [Option<RgbTextureId>; 2]| !colours.iter().flatten().all(is_black);
        self.is_glossy |= lobes.gloss.is_some_and(|layer| is_visible(layer.colours));
        let is_opaque = |id| textures.constant_rgb(id) == Some(Vec3::ONE);
        self.is_specular |= lobes.opacity.is_some_and(|id| !is_opaque(id));
        match lobes.dielectric.filter(|layer| is_visible(layer.colours)) {
            Some(layer) => self.with_microfacets(textures, &layer.roughness),
            None => self,
        }
    }
}

impl Roughness {
    /// Whether the roughness is the same constant in both tangent directions.
    pub fn is_isotropic(&self, textures: &Textures) -> bool {
        let [u, v] = [self.u, self.v].map(|id| textures.constant_float(id));
        u.is_some() && u == v
    }

    /// Whether the surface is perfectly specular: of constant roughness near 0, in a dialect with smooth surfaces.
    fn is_smooth(&self, textures: &Textures) -> bool {
        let is_smooth = |id| {
            let alpha = textures.constant_float(id).map(|roughness| self.scale.alpha(roughness));
            alpha.is_some_and(|alpha| alpha < RoughnessScale::MIN_ROUGH_ALPHA)
        };
        let has_smooth = matches!(self.scale, RoughnessScale::Alpha | RoughnessScale::SquareRoot);
        has_smooth && is_smooth(self.u) && is_smooth(self.v)
    }
}

impl Metal {
    /// Whether the metal is the same at every point.
    pub fn is_constant(&self, textures: &Textures) -> bool {
        let is_constant = |id| textures.constant_rgb(id).is_some();
        match *self {
            Metal::Fresnel { eta, k } => is_constant(eta) && is_constant(k),
            Metal::Reflectance(reflectance) => is_constant(reflectance),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::pbrt::read_str;

    /// The traits of a material, given as a pbrt-v4 directive's type and parameters.
    fn traits(material: &str) -> MaterialTraits {
        let scene = read_str(&format!("WorldBegin Material {material}"), Path::new("")).unwrap();
        MaterialTraits::new(&scene.textures, scene.materials.last().unwrap())
    }

    #[test]
    fn roughness_distinguishes_specular_from_glossy() {
        let none = MaterialTraits::default();
        assert_eq!(traits("\"diffuse\""), none);
        let smooth = traits("\"dielectric\"");
        assert_eq!(smooth, MaterialTraits { is_specular: true, chooses_lobe: true, ..none });
        let rough = traits("\"conductor\" \"float roughness\" .1");
        assert_eq!(rough, MaterialTraits { is_glossy: true, ..none });
        assert_eq!(traits("\"interface\""), MaterialTraits { is_interface: true, ..none });
    }

    #[test]
    fn anisotropy_and_bump_maps_need_the_parametrisation() {
        let anisotropic = "\"conductor\" \"float uroughness\" .1 \"float vroughness\" .3";
        assert!(traits(anisotropic).needs_parametrisation);
        // The reader drops a constant displacement, which bumps nothing.
        let bumped = "\"diffuse\" Texture \"h\" \"float\" \"checkerboard\"
            Material \"diffuse\" \"texture displacement\" \"h\"";
        assert!(traits(bumped).needs_parametrisation);
        assert!(!traits("\"diffuse\"").needs_parametrisation);
    }
}
