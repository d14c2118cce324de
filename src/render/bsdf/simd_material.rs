//! Materials whose BSDFs are evaluated and sampled in SIMD: diffuse reflection, and rough isotropic conductors that
//! are constant over the surface.
//!
//! Their scattering depends on the shading normal alone, not on tangents.

use glam::{Vec2, Vec3};

use super::bxdf::Bxdf;
use super::conductor::Conductor;
use super::material_evaluator::MaterialEvaluator;
use crate::scene::material::RoughnessScale;
use crate::scene::texture::TexturePoint;
use crate::scene::{Material, MaterialKind, RgbTextureId, Textures};

/// A material that is shaded in SIMD.
#[derive(Clone, Copy, Debug)]
pub enum SimdMaterial {
    /// `constant` is the value of the reflectance if it is constant.
    Diffuse {
        reflectance: RgbTextureId,
        constant: Option<Vec3>,
    },
    Conductor(Conductor),
}

impl SimdMaterial {
    /// `None` for materials that are shaded by [`super::Bsdf`].
    pub fn new(textures: &Textures, material: &Material) -> Option<Self> {
        if material.displacement.is_some() || material.normal_map.is_some() {
            return None;
        }
        // Any point gives the values of constant textures.
        let evaluator =
            MaterialEvaluator { textures, at: TexturePoint { uv: Vec2::ZERO, position: Vec3::ZERO } };
        match material.kind {
            MaterialKind::Diffuse { reflectance } => {
                let is_constant = textures.constant_rgb(reflectance).is_some();
                let constant = is_constant.then(|| evaluator.colour(reflectance));
                Some(Self::Diffuse { reflectance, constant })
            }
            MaterialKind::Conductor { metal, roughness } => {
                let is_ggx = roughness.scale != RoughnessScale::InverseExponent;
                (metal.is_constant(textures) && roughness.is_isotropic(textures) && is_ggx)
                    .then(|| evaluator.conductor(metal, roughness))
                    .filter(|conductor| !conductor.is_specular())
                    .map(Self::Conductor)
            }
            _ => None,
        }
    }

    /// Whether the BSDF is the same at every point.
    pub fn is_constant(&self) -> bool {
        !matches!(self, Self::Diffuse { constant: None, .. })
    }
}
