//! A dielectric boundary that colours reflected and transmitted light: the `glass` of pbrt-v2 and v3.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::dielectric::Dielectric;
use super::directions::same_hemisphere;
use super::fresnel;

/// A boundary with a colour each for reflected and transmitted light.
#[derive(Clone, Copy, Debug)]
pub(super) struct TintedDielectric {
    pub dielectric: Dielectric,
    pub reflected: Vec3,
    pub transmitted: Vec3,
}

impl TintedDielectric {
    fn tint(&self, transmission: bool) -> Vec3 {
        if transmission { self.transmitted } else { self.reflected }
    }
}

impl Bxdf for TintedDielectric {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.tint(!same_hemisphere(wo, wi)) * self.dielectric.eval(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.dielectric.pdf(wo, wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sample = self.dielectric.sample(wo, u_lobe, u)?;
        Some(BsdfSample { weight: self.tint(sample.transmission) * sample.weight, ..sample })
    }

    fn is_specular(&self) -> bool {
        self.dielectric.is_specular()
    }

    fn transmits(&self) -> bool {
        true
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let reflectance = fresnel::dielectric(wo.z.abs(), self.dielectric.relative_eta(wo));
        // Beyond the critical angle tilted microfacets still transmit: the lobe has to be sampled there
        let reflectance = if self.is_specular() { reflectance } else { reflectance.clamp(0.05, 0.95) };
        self.reflected * reflectance + self.transmitted * (1.0 - reflectance)
    }
}
