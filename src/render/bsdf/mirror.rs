//! A perfect mirror whose reflectance is independent of the angle: the `mirror` of pbrt-v2 and v3.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::reflect;

#[derive(Clone, Copy, Debug)]
pub(super) struct Mirror {
    pub reflectance: Vec3,
}

impl Bxdf for Mirror {
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    fn pdf(&self, _wo: Vec3, _wi: Vec3) -> f32 {
        0.0
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        Some(BsdfSample::specular(reflect(wo), self.reflectance))
    }

    fn is_specular(&self) -> bool {
        true
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        self.reflectance
    }
}
