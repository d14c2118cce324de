//! Measured BRDFs: tabulated values, sampled by a mixture of the table's half vectors and a cosine-weighted
//! hemisphere.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::{cosine_hemisphere_pdf, same_hemisphere, sample_cosine_hemisphere, to_hemisphere_of};
use crate::scene::measured_brdf::MeasuredBrdf;

/// Probability of sampling the cosine-weighted hemisphere; the rest samples half vectors.
const COSINE_PROBABILITY: f32 = 0.5;

#[derive(Clone, Copy, Debug)]
pub(super) struct Measured<'s> {
    pub table: &'s MeasuredBrdf,
}

impl Bxdf for Measured<'_> {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if same_hemisphere(wo, wi) { self.table.value(wo, wi) * wi.z.abs() } else { Vec3::ZERO }
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_hemisphere(wo, wi) {
            return 0.0;
        }
        let Some(half) = (wo + wi).try_normalize() else { return 0.0 };
        let half_vector_pdf =
            self.table.half_vector_pdf(half.z.abs()) / (4.0 * wo.dot(half)).max(f32::MIN_POSITIVE);
        COSINE_PROBABILITY * cosine_hemisphere_pdf(wi) + (1.0 - COSINE_PROBABILITY) * half_vector_pdf
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = if u_lobe < COSINE_PROBABILITY {
            to_hemisphere_of(sample_cosine_hemisphere(u), wo)
        } else {
            let half = to_hemisphere_of(self.table.sample_half_vector(u), wo);
            let cos = wo.dot(half);
            if cos <= 0.0 {
                return None;
            }
            (half * (2.0 * cos) - wo).normalize_or(half)
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        self.table.albedo(wo.z.abs())
    }
}
