//! A glossy layer over a diffuse base that loses what the gloss reflects: Ashikhmin and Shirley,
//! *An anisotropic Phong BRDF model* (2000), as pbrt-v2's and v3's `substrate` has it.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::diffuse::{cosine_pdf, cosine_sample};
use super::frame::{on_side_of, same_side};
use super::gloss::Facets;
use super::{BsdfSample, Scatter};

/// Share of samples that the base draws; the gloss draws the rest.
const BASE_SHARE: f32 = 0.5;

#[derive(Clone, Copy, Debug)]
pub(super) struct FresnelBlend {
    pub diffuse: Vec3,
    /// Reflectance of the gloss at normal incidence.
    pub specular: Vec3,
    pub facets: Facets,
}

/// 1 − (1 − cos / 2)⁵: what the base gets of light from this angle.
fn reaches_base(cos: f32) -> f32 {
    1.0 - (1.0 - 0.5 * cos).powi(5)
}

impl FresnelBlend {
    /// Schlick's approximation.
    fn fresnel(&self, cos: f32) -> Vec3 {
        self.specular + (1.0 - self.specular) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
    }
}

impl Scatter for FresnelBlend {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !same_side(wo, wi) {
            return Vec3::ZERO;
        }
        let Some(m) = (wo + wi).try_normalize() else { return Vec3::ZERO };
        let (cos_o, cos_i, cos_m) = (wo.z.abs(), wi.z.abs(), wi.dot(m));
        let base = self.diffuse
            * (1.0 - self.specular)
            * (28.0 / (23.0 * PI) * reaches_base(cos_i) * reaches_base(cos_o));
        let gloss = self.fresnel(cos_m) * self.facets.density(m) / (4.0 * cos_m.max(1e-6) * cos_i.max(cos_o));
        (base + gloss) * cos_i
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_side(wo, wi) {
            return 0.0;
        }
        BASE_SHARE * cosine_pdf(wi) + (1.0 - BASE_SHARE) * self.facets.reflect_pdf(wo, wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = if u_lobe < BASE_SHARE {
            on_side_of(cosine_sample(u), wo)
        } else {
            self.facets.reflect_sample(wo, u)?
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let gloss = self.fresnel(wo.z.abs());
        self.diffuse * (1.0 - self.specular) * reaches_base(wo.z.abs()) + gloss
    }
}
