//! A glossy layer over a diffuse base, blended by Fresnel reflectance: Ashikhmin and Shirley, *An anisotropic
//! Phong BRDF model* (2000), the `substrate` of pbrt-v2 and v3.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::{cosine_hemisphere_pdf, same_hemisphere, sample_cosine_hemisphere, to_hemisphere_of};
use super::microfacet_distribution::MicrofacetDistribution;

/// Probability of sampling the base; the rest samples the glossy layer.
const BASE_PROBABILITY: f32 = 0.5;

#[derive(Clone, Copy, Debug)]
pub(super) struct FresnelBlend {
    pub diffuse: Vec3,
    /// Reflectance of the glossy layer at normal incidence.
    pub specular: Vec3,
    pub distribution: MicrofacetDistribution,
}

/// 1 − (1 − cos / 2)⁵: the fraction of light from this angle that reaches the base.
fn base_fraction(cos: f32) -> f32 {
    1.0 - (1.0 - 0.5 * cos).powi(5)
}

impl FresnelBlend {
    /// Fresnel reflectance of the glossy layer in Schlick's approximation.
    fn fresnel(&self, cos: f32) -> Vec3 {
        self.specular + (1.0 - self.specular) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
    }
}

impl Bxdf for FresnelBlend {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !same_hemisphere(wo, wi) {
            return Vec3::ZERO;
        }
        let Some(m) = (wo + wi).try_normalize() else { return Vec3::ZERO };
        let (cos_o, cos_i, cos_m) = (wo.z.abs(), wi.z.abs(), wi.dot(m));
        let base = self.diffuse
            * (1.0 - self.specular)
            * (28.0 / (23.0 * PI) * base_fraction(cos_i) * base_fraction(cos_o));
        let gloss =
            self.fresnel(cos_m) * self.distribution.density(m) / (4.0 * cos_m.max(1e-6) * cos_i.max(cos_o));
        (base + gloss) * cos_i
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_hemisphere(wo, wi) {
            return 0.0;
        }
        BASE_PROBABILITY * cosine_hemisphere_pdf(wi)
            + (1.0 - BASE_PROBABILITY) * self.distribution.reflection_pdf(wo, wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = if u_lobe < BASE_PROBABILITY {
            to_hemisphere_of(sample_cosine_hemisphere(u), wo)
        } else {
            self.distribution.sample_reflection(wo, u)?
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let gloss = self.fresnel(wo.z.abs());
        self.diffuse * (1.0 - self.specular) * base_fraction(wo.z.abs()) + gloss
    }
}
