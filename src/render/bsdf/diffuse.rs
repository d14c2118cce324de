//! Lambertian reflection and transmission, the same from both sides.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{BsdfSample, Scatter, frame::on_side_of, frame::same_side};
use crate::render::disk::concentric_disk;

/// A diffuse surface; colours in [0, 1]. As in pbrt-v4, their sum is the caller's business.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diffuse {
    pub reflectance: Vec3,
    pub transmittance: Vec3,
}

impl Diffuse {
    /// Probability that a sample is reflected; zero for a black surface.
    fn reflect_probability(&self) -> f32 {
        let (r, t) = (self.reflectance.max_element(), self.transmittance.max_element());
        if r > 0.0 { r / (r + t) } else { 0.0 }
    }

    fn is_black(&self) -> bool {
        self.reflectance == Vec3::ZERO && self.transmittance == Vec3::ZERO
    }
}

impl Scatter for Diffuse {
    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let albedo = if same_side(wo, wi) { self.reflectance } else { self.transmittance };
        albedo * (FRAC_1_PI * wi.z.abs())
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.is_black() {
            return 0.0;
        }
        let p = self.reflect_probability();
        let share = if same_side(wo, wi) { p } else { 1.0 - p };
        share * cosine_pdf(wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if self.is_black() {
            return None;
        }
        let p = self.reflect_probability();
        let reflect = u_lobe < p;
        let (albedo, share) = if reflect { (self.reflectance, p) } else { (self.transmittance, 1.0 - p) };
        let wi = on_side_of(cosine_sample(u), if reflect { wo } else { -wo });
        let pdf = share * cosine_pdf(wi);
        Some(BsdfSample { transmission: !reflect, ..BsdfSample::glossy(wi, albedo / share, pdf) })
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        self.reflectance + self.transmittance
    }
}

/// Density of [`cosine_sample`] on either side.
#[inline(always)]
pub(super) fn cosine_pdf(wi: Vec3) -> f32 {
    FRAC_1_PI * wi.z.abs()
}

/// A direction of the upper hemisphere, cosine-distributed: a point of the disk, lifted.
#[inline(always)]
pub(super) fn cosine_sample(u: Vec2) -> Vec3 {
    let p = concentric_disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}
