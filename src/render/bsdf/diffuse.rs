//! Lambertian reflection and transmission, identical on both sides (pbrt-v4, section 9.3 and
//! `DiffuseTransmissionBxDF`).

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::{cosine_hemisphere_pdf, same_hemisphere, sample_cosine_hemisphere, to_hemisphere_of};

/// A diffuse surface; colours in [0, 1]. As in pbrt-v4, their sum may exceed 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diffuse {
    pub reflectance: Vec3,
    pub transmittance: Vec3,
}

impl Diffuse {
    /// Probability of sampling a reflection; 0 for a black surface.
    fn reflection_probability(&self) -> f32 {
        let (r, t) = (self.reflectance.max_element(), self.transmittance.max_element());
        if r > 0.0 { r / (r + t) } else { 0.0 }
    }

    fn is_black(&self) -> bool {
        self.reflectance == Vec3::ZERO && self.transmittance == Vec3::ZERO
    }
}

impl Bxdf for Diffuse {
    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let albedo = if same_hemisphere(wo, wi) { self.reflectance } else { self.transmittance };
        albedo * (FRAC_1_PI * wi.z.abs())
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.is_black() {
            return 0.0;
        }
        let p_reflection = self.reflection_probability();
        let p = if same_hemisphere(wo, wi) { p_reflection } else { 1.0 - p_reflection };
        p * cosine_hemisphere_pdf(wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if self.is_black() {
            return None;
        }
        let p_reflection = self.reflection_probability();
        let is_reflection = u_lobe < p_reflection;
        let (albedo, p) = if is_reflection {
            (self.reflectance, p_reflection)
        } else {
            (self.transmittance, 1.0 - p_reflection)
        };
        let wi = to_hemisphere_of(sample_cosine_hemisphere(u), if is_reflection { wo } else { -wo });
        let pdf = p * cosine_hemisphere_pdf(wi);
        Some(BsdfSample { transmission: !is_reflection, ..BsdfSample::glossy(wi, albedo / p, pdf) })
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn transmits(&self) -> bool {
        self.transmittance != Vec3::ZERO
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        self.reflectance + self.transmittance
    }
}
