//! Rough diffuse reflection: Oren and Nayar, *Generalization of Lambert's reflectance model*
//! (1994), the qualitative model of their equation 30, as pbrt-v2 and v3 have it.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::diffuse::{cosine_pdf, cosine_sample};
use super::frame::{on_side_of, same_side};
use super::{BsdfSample, Scatter};

#[derive(Clone, Copy, Debug)]
pub(super) struct OrenNayar {
    reflectance: Vec3,
    a: f32,
    b: f32,
}

impl OrenNayar {
    /// `sigma`: standard deviation of the facets' slope angle in degrees, brought into [0, 90].
    pub fn new(reflectance: Vec3, sigma: f32) -> Self {
        let sigma = super::bounded(sigma, 90.0).to_radians();
        let sigma2 = sigma * sigma;
        Self { reflectance, a: 1.0 - sigma2 / (2.0 * (sigma2 + 0.33)), b: 0.45 * sigma2 / (sigma2 + 0.09) }
    }
}

impl Scatter for OrenNayar {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !same_side(wo, wi) {
            return Vec3::ZERO;
        }
        let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
        // sin α tan β cos Δφ, both sines in the dot product: the smaller angle has the tangent.
        let across = (wo.x * wi.x + wo.y * wi.y).max(0.0) / cos_o.max(cos_i);
        self.reflectance * (FRAC_1_PI * (self.a + self.b * across) * cos_i)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if same_side(wo, wi) { cosine_pdf(wi) } else { 0.0 }
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = on_side_of(cosine_sample(u), wo);
        let pdf = cosine_pdf(wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        self.reflectance
    }
}
