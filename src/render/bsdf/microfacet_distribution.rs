//! A rough microfacet distribution of either kind (pbrt-v3's `MicrofacetDistribution`).

use glam::{Vec2, Vec3};

use super::blinn::Blinn;
use super::ggx::Ggx;

/// A microfacet distribution that is never smooth.
#[derive(Clone, Copy, Debug)]
pub(super) enum MicrofacetDistribution {
    Ggx(Ggx),
    Blinn(Blinn),
}

impl MicrofacetDistribution {
    /// D(m): area of microfacets per solid angle of normals and surface area.
    pub fn density(self, m: Vec3) -> f32 {
        match self {
            Self::Ggx(ggx) => ggx.density(m),
            Self::Blinn(blinn) => blinn.density(m),
        }
    }

    /// f |cos wi| of reflection without the Fresnel reflectance, and the cosine to the microfacet's normal.
    pub fn reflection_eval(self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        match self {
            Self::Ggx(ggx) => ggx.reflection_eval(wo, wi),
            Self::Blinn(blinn) => blinn.reflection_eval(wo, wi),
        }
    }

    /// Density per solid angle of [`Self::sample_reflection`].
    pub fn reflection_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Self::Ggx(ggx) => ggx.reflection_pdf(wo, wi),
            Self::Blinn(blinn) => blinn.reflection_pdf(wo, wi),
        }
    }

    /// Reflects `wo` at a sampled normal; `None` if the reflection is below the surface.
    pub fn sample_reflection(self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        match self {
            Self::Ggx(ggx) => Some(ggx.sample_reflection(wo, u)?.wi),
            Self::Blinn(blinn) => blinn.sample_reflection(wo, u),
        }
    }
}
