//! Metals: GGX microfacets, or a perfect mirror, with complex Fresnel reflectance.

use glam::{Vec2, Vec3};

use super::frame::{mirror, same_side};
use super::{BsdfSample, Scatter, fresnel, microfacet::Ggx};

/// A conductor of complex index `eta` + i `k` relative to what is around it.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    pub(super) eta: Vec3,
    pub(super) k: Vec3,
    pub(super) ggx: Ggx,
}

impl Scatter for Conductor {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if self.ggx.is_smooth() || !same_side(wo, wi) {
            return Vec3::ZERO;
        }
        let (value, cos) = self.ggx.reflect_eval(wo, wi);
        fresnel::conductor(cos, self.eta, self.k) * value
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.ggx.is_smooth() || !same_side(wo, wi) {
            return 0.0;
        }
        self.ggx.reflect_pdf(wo, wi)
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if self.ggx.is_smooth() {
            let f = fresnel::conductor(wo.z.abs(), self.eta, self.k);
            return Some(BsdfSample::specular(mirror(wo), f));
        }
        let reflection = self.ggx.reflect_sample(wo, u)?;
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
