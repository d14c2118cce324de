//! A conductor with complex Fresnel reflectance: smooth, or of GGX microfacets (pbrt-v4, sections 9.4 and 9.6).

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::{reflect, same_hemisphere};
use super::fresnel;
use super::ggx::Ggx;

/// A conductor of complex index of refraction `eta` + i `k` relative to the surrounding medium.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    pub(super) eta: Vec3,
    pub(super) k: Vec3,
    pub(super) ggx: Ggx,
}

impl Bxdf for Conductor {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if self.ggx.is_smooth() || !same_hemisphere(wo, wi) {
            return Vec3::ZERO;
        }
        let (value, cos) = self.ggx.reflection_eval(wo, wi);
        fresnel::conductor(cos, self.eta, self.k) * value
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.ggx.is_smooth() || !same_hemisphere(wo, wi) {
            return 0.0;
        }
        self.ggx.reflection_pdf(wo, wi)
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if self.ggx.is_smooth() {
            let f = fresnel::conductor(wo.z.abs(), self.eta, self.k);
            return Some(BsdfSample::specular(reflect(wo), f));
        }
        let reflection = self.ggx.sample_reflection(wo, u)?;
        let f = fresnel::conductor(reflection.cos, self.eta, self.k);
        let pdf = self.pdf(wo, reflection.wi);
        Some(BsdfSample::glossy(reflection.wi, f * reflection.weight, pdf))
    }

    fn is_specular(&self) -> bool {
        self.ggx.is_smooth()
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        fresnel::conductor(wo.z.abs(), self.eta, self.k)
    }
}
