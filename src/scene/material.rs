//! What surfaces are made of, as data. BSDFs are made from it by the renderer.

use std::sync::Arc;

use super::measured::MeasuredBrdf;
use super::{FloatTextureId, RgbTextureId};

/// Index into [`super::Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct MaterialId(pub u32);

/// A material: what scatters, and what bends the shading normal.
#[derive(Clone, Debug)]
pub struct Material {
    /// The scene's name for it; empty when it has none.
    pub name: String,
    pub kind: MaterialKind,
    /// Height in scene units, whose gradient bends the normal.
    pub displacement: Option<FloatTextureId>,
    /// Tangent-space normals, encoded in [0, 1].
    pub normal_map: Option<RgbTextureId>,
}

/// Roughness along the two tangent directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness {
    pub u: FloatTextureId,
    pub v: FloatTextureId,
    pub scale: RoughnessScale,
}

/// What a roughness means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoughnessScale {
    /// GGX's alpha.
    Alpha,
    /// pbrt-v4's: alpha is its root.
    SquareRoot,
    /// pbrt-v3's: alpha is a polynomial of its logarithm.
    Logarithm,
    /// pbrt-v2's: not GGX, but Blinn's microfacets of exponent 1 / roughness.
    InverseExponent,
}

impl RoughnessScale {
    /// GGX's alpha of a roughness; for Blinn's exponent e it is that of the same mean slope,
    /// √(2 / (e + 2)).
    pub fn alpha(self, roughness: f32) -> f32 {
        match self {
            RoughnessScale::Alpha => roughness,
            RoughnessScale::SquareRoot => roughness.max(0.0).sqrt(),
            RoughnessScale::Logarithm => {
                let x = roughness.max(1e-3).ln();
                let terms = [1.62142, 0.819955, 0.1734, 0.0171201, 0.000640711];
                terms.iter().rev().fold(0.0, |sum, term| sum * x + term)
            }
            RoughnessScale::InverseExponent => (2.0 * roughness / (1.0 + 2.0 * roughness)).max(0.0).sqrt(),
        }
    }
}

/// Complex index of refraction by RGB, or the reflectance at normal incidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Metal {
    Fresnel { eta: RgbTextureId, k: RgbTextureId },
    Reflectance(RgbTextureId),
}

/// Microfacets over other parts, or a boundary, with the colour that each side's light gets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Of reflected and of transmitted light; `None` is black.
    pub colours: [Option<RgbTextureId>; 2],
    /// Relative index of refraction.
    pub eta: f32,
    pub roughness: Roughness,
}

/// The parts of the materials of pbrt-v2 and v3 that simply add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Additive {
    /// Lambertian reflection and transmission; `None` is black.
    pub diffuse: [Option<RgbTextureId>; 2],
    /// Microfacets that reflect; what is transmitted is the mirror image below the surface.
    pub gloss: Option<Layer>,
    /// A boundary that reflects and refracts.
    pub dielectric: Option<Layer>,
    /// Share of light that meets any of them; the rest goes straight through. `None` is all.
    pub opacity: Option<RgbTextureId>,
}

/// The scattering models of pbrt-v4 and of its older versions, and one for invisible boundaries.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambertian reflection.
    Diffuse { reflectance: RgbTextureId },
    /// Rough diffuse reflection; `sigma` in degrees (v2, v3).
    OrenNayar { reflectance: RgbTextureId, sigma: FloatTextureId },
    /// A mirror that is the same at every angle (v2, v3).
    Mirror { reflectance: RgbTextureId },
    /// A diffuse base under gloss; `specular` at normal incidence (v2, v3).
    FresnelBlend { diffuse: RgbTextureId, specular: RgbTextureId, roughness: Roughness },
    /// A sum of parts (v2, v3).
    Additive(Box<Additive>),
    /// A table of measured values.
    Measured(Arc<MeasuredBrdf>),
    /// Lambertian reflection and transmission.
    DiffuseTransmission { reflectance: RgbTextureId, transmittance: RgbTextureId },
    /// GGX microfacet conductor.
    Conductor { metal: Metal, roughness: Roughness },
    /// GGX microfacet dielectric that reflects and refracts.
    Dielectric { eta: f32, roughness: Roughness },
    /// A pane without thickness: reflects and lets straight through.
    ThinDielectric { eta: f32 },
    /// Diffuse base under a dielectric coat.
    CoatedDiffuse { reflectance: RgbTextureId, eta: f32, roughness: Roughness },
    /// Conductor under a dielectric coat.
    CoatedConductor { metal: Metal, conductor_roughness: Roughness, eta: f32, interface_roughness: Roughness },
    /// `amount` of the second, the rest of the first.
    Mix { first: super::MaterialId, second: super::MaterialId, amount: FloatTextureId },
    /// A boundary that light passes unchanged.
    Interface,
}
