//! Materials: parameters of scattering models. The renderer makes BSDFs from them.

use std::sync::Arc;

use super::measured_brdf::MeasuredBrdf;
use super::{FloatTextureId, RgbTextureId};

/// Index into [`super::Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct MaterialId(pub u32);

/// A material: a scattering model and perturbations of the shading normal.
#[derive(Clone, Debug)]
pub struct Material {
    /// The name in the scene; empty if it has none.
    pub name: String,
    pub kind: MaterialKind,
    /// Displacement in scene units, used for bump mapping only.
    pub displacement: Option<FloatTextureId>,
    /// Tangent-space normals, encoded in [0, 1].
    pub normal_map: Option<RgbTextureId>,
}

/// Microfacet roughness along the two tangent directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness {
    pub u: FloatTextureId,
    pub v: FloatTextureId,
    pub scale: RoughnessScale,
}

/// Relation of a roughness parameter to the microfacet distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoughnessScale {
    /// GGX's alpha itself.
    Alpha,
    /// Alpha is the square root (pbrt-v4).
    SquareRoot,
    /// Alpha is a polynomial of the logarithm (pbrt-v3).
    Logarithm,
    /// Blinn's distribution with exponent 1 / roughness instead of GGX (pbrt-v2).
    InverseExponent,
}

impl RoughnessScale {
    /// Alpha below which a surface is perfectly specular (pbrt-v4).
    pub const MIN_ROUGH_ALPHA: f32 = 1e-3;

    /// GGX's alpha for a roughness. For Blinn's exponent e, the alpha of equal mean slope,
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

/// Fresnel parameters of a conductor: the complex index of refraction, or the reflectance at normal
/// incidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Metal {
    Fresnel { eta: RgbTextureId, k: RgbTextureId },
    Reflectance(RgbTextureId),
}

/// A microfacet lobe with a tint for reflection and for transmission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// Tint of reflection and of transmission; `None` is black.
    pub colours: [Option<RgbTextureId>; 2],
    /// Relative index of refraction.
    pub eta: f32,
    pub roughness: Roughness,
}

/// A sum of lobes (materials of pbrt-v2 and v3).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Additive {
    /// Lambertian reflection and transmission; `None` is black.
    pub diffuse: [Option<RgbTextureId>; 2],
    /// A glossy lobe; its transmission is the mirror image below the surface.
    pub gloss: Option<Lobe>,
    /// Whether the gloss has the inverse index of refraction seen from behind (v3), not the same (v2).
    pub inverts_gloss_behind: bool,
    /// A dielectric interface that reflects and refracts.
    pub dielectric: Option<Lobe>,
    /// Fraction of light that is scattered; the rest passes straight through. `None` is opaque.
    pub opacity: Option<RgbTextureId>,
}

/// The scattering models of pbrt-v4, v3 and v2.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambertian reflection.
    Diffuse { reflectance: RgbTextureId },
    /// Oren-Nayar reflection; `sigma` in degrees (v2, v3).
    OrenNayar { reflectance: RgbTextureId, sigma: FloatTextureId },
    /// Specular reflection without Fresnel reflectance (v2, v3).
    Mirror { reflectance: RgbTextureId },
    /// Ashikhmin-Shirley: a diffuse base under a glossy coat; `specular` at normal incidence (v2, v3).
    FresnelBlend { diffuse: RgbTextureId, specular: RgbTextureId, roughness: Roughness },
    /// A sum of lobes (v2, v3).
    Additive(Box<Additive>),
    /// A measured BRDF.
    Measured(Arc<MeasuredBrdf>),
    /// Lambertian reflection and transmission.
    DiffuseTransmission { reflectance: RgbTextureId, transmittance: RgbTextureId },
    /// GGX microfacet conductor.
    Conductor { metal: Metal, roughness: Roughness },
    /// GGX microfacet dielectric that reflects and refracts.
    Dielectric { eta: f32, roughness: Roughness },
    /// A thin pane that reflects and transmits without bending light.
    ThinDielectric { eta: f32 },
    /// A diffuse base under a dielectric coating, whose thickness is in mean free paths of a medium that absorbs.
    CoatedDiffuse { reflectance: RgbTextureId, eta: f32, roughness: Roughness, thickness: FloatTextureId },
    /// A conductor under such a coating.
    CoatedConductor {
        metal: Metal,
        conductor_roughness: Roughness,
        eta: f32,
        interface_roughness: Roughness,
        thickness: FloatTextureId,
    },
    /// A stochastic choice: `second` with probability `amount`, otherwise `first`.
    Mix { first: super::MaterialId, second: super::MaterialId, amount: FloatTextureId },
    /// An interface between media that does not change light.
    Interface,
}
