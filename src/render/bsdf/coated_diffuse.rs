//! A diffuse base under a dielectric coat, in closed form.
//!
//! Light enters the coat, bounces between base and coat any number of times and leaves. With the coat's
//! transmittance T, the fraction F of diffuse light that comes back to the base and the base's albedo k, the geometric
//! series over the bounces is
//!
//! ```text
//! f(wo, wi) = T(wo) T(wi) / η² · k / π / (1 − k F)
//! ```
//!
//! (Wolff, *Diffuse-reflectance model for smooth dielectric surfaces*, 1994; exact for a smooth coat without absorption over a
//! Lambertian base). T and F include what the coat absorbs; without that a white base reflects all light that the coat does
//! not reflect.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::coat::Coat;
use super::directions::{cosine_hemisphere_pdf, same_hemisphere, sample_cosine_hemisphere, to_hemisphere_of};

#[derive(Clone, Copy, Debug)]
pub(super) struct CoatedDiffuse {
    coat: Coat,
    /// k / (1 − k F) / η²
    base: Vec3,
    /// Fraction of the light at the base that leaves the coat again.
    base_albedo: Vec3,
}

impl CoatedDiffuse {
    /// `reflectance` in [0, 1].
    pub fn new(coat: Coat, reflectance: Vec3) -> Self {
        // 1 - k F is positive: F is 1 only for an infinite index of refraction.
        let series = reflectance / (1.0 - reflectance * coat.return_to_base());
        Self { coat, base: series / (coat.eta * coat.eta), base_albedo: series * coat.escape() }
    }

    /// Probability of sampling the coat's lobe, given its reflectance for light from `wo`: its fraction of the albedo's
    /// brightest channel. `None` if nothing scatters.
    fn coat_probability(&self, coat: f32) -> Option<f32> {
        let total = coat + (1.0 - coat) * self.base_albedo.max_element();
        (total > 0.0).then(|| coat / total)
    }
}

impl Bxdf for CoatedDiffuse {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.eval_and_pdf(wo, wi).0
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_and_pdf(wo, wi).1
    }

    fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if !same_hemisphere(wo, wi) {
            return (Vec3::ZERO, 0.0);
        }
        let [coat_o, coat_i] = [wo, wi].map(|w| self.coat.reflectance(w.z.abs()));
        let (coat_value, coat_pdf) = self.coat.eval_and_pdf(wo, wi);
        let through =
            (1.0 - coat_o) * (1.0 - coat_i) * self.coat.crossing(wo.z.abs()) * self.coat.crossing(wi.z.abs());
        let value = self.base * (through * FRAC_1_PI * wi.z.abs()) + coat_value;
        let pdf = self.coat_probability(coat_o);
        (value, pdf.map_or(0.0, |p| p * coat_pdf + (1.0 - p) * cosine_hemisphere_pdf(wi)))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let p = self.coat_probability(self.coat.reflectance(wo.z.abs()))?;
        let wi = if u_lobe >= p {
            to_hemisphere_of(sample_cosine_hemisphere(u), wo)
        } else if self.coat.ggx.is_smooth() {
            return Some(self.coat.specular_sample(wo, p));
        } else {
            self.coat.ggx.sample_reflection(wo, u)?.wi
        };
        let (value, pdf) = self.eval_and_pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, value / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let coat = self.coat.reflectance(wo.z.abs());
        self.base_albedo * ((1.0 - coat) * self.coat.crossing(wo.z.abs())) + coat
    }
}
