//! Measured BRDFs: the table's value, drawn by its half vectors, and by the cosine where it is
//! nearly diffuse.

use glam::{Vec2, Vec3};

use super::diffuse::{cosine_pdf, cosine_sample};
use super::frame::{on_side_of, same_side};
use super::{BsdfSample, Scatter};
use crate::scene::measured::MeasuredBrdf;

/// Share of samples drawn by the cosine; the half vectors draw the rest.
const COSINE_SHARE: f32 = 0.5;

#[derive(Clone, Copy, Debug)]
pub(super) struct Measured<'s> {
    pub table: &'s MeasuredBrdf,
}

impl Scatter for Measured<'_> {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if same_side(wo, wi) { self.table.value(wo, wi) * wi.z.abs() } else { Vec3::ZERO }
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_side(wo, wi) {
            return 0.0;
        }
        let Some(half) = (wo + wi).try_normalize() else { return 0.0 };
        let by_half = self.table.half_vector_pdf(half.z.abs()) / (4.0 * wo.dot(half)).max(f32::MIN_POSITIVE);
        COSINE_SHARE * cosine_pdf(wi) + (1.0 - COSINE_SHARE) * by_half
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = if u_lobe < COSINE_SHARE {
            on_side_of(cosine_sample(u), wo)
        } else {
            let half = on_side_of(self.table.sample_half_vector(u), wo);
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
