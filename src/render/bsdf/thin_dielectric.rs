//! A pane of a dielectric without thickness, with all its interreflections; transmitted light keeps its direction
//! (pbrt-v4, section 9.5.1).

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::reflect;
use super::fresnel;

/// A pane between air and air.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThinDielectric {
    pub eta: f32,
}

impl ThinDielectric {
    fn reflectance(&self, wo: Vec3) -> f32 {
        let r = fresnel::dielectric(wo.z.abs(), self.eta);
        // R + T²R + T²R³ + ... with T = 1 - R
        2.0 * r / (1.0 + r)
    }
}

impl Bxdf for ThinDielectric {
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    fn pdf(&self, _wo: Vec3, _wi: Vec3) -> f32 {
        0.0
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let reflects = u_lobe < self.reflectance(wo);
        let wi = if reflects { reflect(wo) } else { -wo };
        Some(BsdfSample { transmission: !reflects, ..BsdfSample::specular(wi, Vec3::ONE) })
    }

    fn is_specular(&self) -> bool {
        true
    }

    fn transmits(&self) -> bool {
        true
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        Vec3::ONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pane_sums_the_reflections_of_both_faces() {
        // 2 R / (1 + R) with R = 0.04
        let pane = ThinDielectric { eta: 1.5 };
        assert!((pane.reflectance(Vec3::Z) - 0.08 / 1.04).abs() < 1e-6);
        let through = pane.sample(Vec3::Z, 0.5, Vec2::ZERO).expect("a pane always scatters");
        assert!(through.transmission && through.wi == -Vec3::Z && through.eta == 1.0);
    }
}
