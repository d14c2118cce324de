//! Rough diffuse reflection as in pbrt-v2 and v3: the qualitative model (equation 30) of Oren and Nayar,
//! *Generalization of Lambert's reflectance model* (1994).

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::clamp::clamp_or_zero;
use super::directions::{cosine_hemisphere_pdf, same_hemisphere, sample_cosine_hemisphere, to_hemisphere_of};

#[derive(Clone, Copy, Debug)]
pub(super) struct OrenNayar {
    reflectance: Vec3,
    a: f32,
    b: f32,
}

impl OrenNayar {
    /// `sigma`: standard deviation of the facets' slope angle in degrees, clamped to [0, 90].
    pub fn new(reflectance: Vec3, sigma: f32) -> Self {
        let sigma = clamp_or_zero(sigma, 90.0).to_radians();
        let sigma2 = sigma * sigma;
        Self { reflectance, a: 1.0 - sigma2 / (2.0 * (sigma2 + 0.33)), b: 0.45 * sigma2 / (sigma2 + 0.09) }
    }
}

impl Bxdf for OrenNayar {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !same_hemisphere(wo, wi) {
            return Vec3::ZERO;
        }
        let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
        // sin α tan β cos Δφ with α the larger angle; the dot product contains both sines.
        let slope_term = (wo.x * wi.x + wo.y * wi.y).max(0.0) / cos_o.max(cos_i);
        self.reflectance * (FRAC_1_PI * (self.a + self.b * slope_term) * cos_i)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if same_hemisphere(wo, wi) { cosine_hemisphere_pdf(wi) } else { 0.0 }
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = to_hemisphere_of(sample_cosine_hemisphere(u), wo);
        let pdf = cosine_hemisphere_pdf(wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        self.reflectance
    }
}
