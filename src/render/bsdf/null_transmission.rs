//! Transmission without a change of direction (Mitsuba's `null` BSDF), which makes a surface partly transparent.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;

/// Transmits light straight on, multiplied by a colour.
#[derive(Clone, Copy, Debug)]
pub(super) struct NullTransmission(pub Vec3);

impl Bxdf for NullTransmission {
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    fn pdf(&self, _wo: Vec3, _wi: Vec3) -> f32 {
        0.0
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        Some(BsdfSample { transmission: true, ..BsdfSample::specular(-wo, self.0) })
    }

    fn is_specular(&self) -> bool {
        true
    }

    fn transmits(&self) -> bool {
        true
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        self.0
    }
}
