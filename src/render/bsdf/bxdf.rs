//! The interface of scattering models (pbrt-v4's `BxDF`, section 9.1.2).

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;

/// A scattering model in its local frame, with z along the shading normal. Directions are unit vectors on either
/// side of the surface, not on the horizon.
///
/// [`Self::sample`] samples with the density [`Self::pdf`], and its weight is `eval / pdf`, except for specular
/// lobes.
pub(super) trait Bxdf {
    /// f |cos wi|, without specular lobes.
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3;
    /// Density per solid angle of samples that are not specular.
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32;
    /// [`Self::eval`] and [`Self::pdf`], for models whose parts both need.
    fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        (self.eval(wo, wi), self.pdf(wo, wi))
    }
    /// Samples a direction: `u_lobe` chooses the lobe and `u` the direction, all in [0, 1). `None` if the sample
    /// is below the surface or nothing scatters.
    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample>;
    /// Whether all lobes are specular.
    fn is_specular(&self) -> bool;
    /// Whether some lobe that is not specular scatters light to the other side of the surface. If all are specular the answer is of no use.
    fn transmits(&self) -> bool {
        false
    }
    /// Estimate of the fraction of light from `wo` that is scattered.
    fn albedo(&self, wo: Vec3) -> Vec3;
}
