//! A dielectric boundary that reflects and refracts: smooth, or of GGX microfacets.
//!
//! Sources: Walter et al., *Microfacet models for refraction through rough surfaces* (2007), equations 16, 17 and
//! 21; pbrt-v4, section 9.7, also for the division of refracted radiance by the squared relative index.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::{reflect, same_hemisphere};
use super::fresnel;
use super::ggx::Ggx;

/// A boundary between air above and a medium of index of refraction `eta` below.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dielectric {
    pub eta: f32,
    pub ggx: Ggx,
}

impl Dielectric {
    /// Index of refraction of the side opposite to `wo` over that of the side of `wo`.
    pub fn relative_eta(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Whether microfacets have no effect: there are none, or nothing is refracted.
    fn is_flat(&self) -> bool {
        self.ggx.is_smooth() || self.eta == 1.0
    }

    /// The normal, on the side of `wo`, of the microfacet that scatters from `wi` to `wo`; `None` if none does.
    fn microfacet_normal(wo: Vec3, wi: Vec3, eta: f32) -> Option<Vec3> {
        let is_reflection = same_hemisphere(wo, wi);
        let m = if is_reflection { wo + wi } else { wo + wi * eta }.try_normalize()?;
        let m = if same_hemisphere(m, wo) { m } else { -m };
        (m.dot(wo) > 0.0 && (m.dot(wi) > 0.0) == is_reflection).then_some(m)
    }
}

/// Jacobian |dm / dwi| of refraction at microfacet `m` (Walter et al., equation 17, with relative `eta`).
fn refraction_jacobian(wo: Vec3, wi: Vec3, m: Vec3, eta: f32) -> f32 {
    wi.dot(m).abs() / (wi.dot(m) + wo.dot(m) / eta).powi(2).max(f32::MIN_POSITIVE)
}

impl Bxdf for Dielectric {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let eta = self.relative_eta(wo);
        if self.is_flat() {
            return Vec3::ZERO;
        }
        let Some(m) = Self::microfacet_normal(wo, wi, eta) else { return Vec3::ZERO };
        let cos = wo.dot(m);
        let reflectance = fresnel::dielectric(cos, eta);
        let microfacets = self.ggx.distribution_and_masking(wo, wi, m);
        Vec3::splat(if same_hemisphere(wo, wi) {
            reflectance * microfacets / 4.0
        } else {
            (1.0 - reflectance) * microfacets * cos * refraction_jacobian(wo, wi, m, eta) / (eta * eta)
        })
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let eta = self.relative_eta(wo);
        if self.is_flat() {
            return 0.0;
        }
        let Some(m) = Self::microfacet_normal(wo, wi, eta) else { return 0.0 };
        let reflectance = fresnel::dielectric(wo.dot(m), eta);
        if same_hemisphere(wo, wi) {
            reflectance * self.ggx.reflection_pdf(wo, wi)
        } else {
            (1.0 - reflectance) * self.ggx.visible_density(wo, m) * refraction_jacobian(wo, wi, m, eta)
        }
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let eta = self.relative_eta(wo);
        let is_flat = self.is_flat();
        let m =
            if is_flat { Vec3::new(0.0, 0.0, 1f32.copysign(wo.z)) } else { self.ggx.sample_visible(wo, u) };
        let cos = wo.dot(m);
        let is_reflection = u_lobe < fresnel::dielectric(cos, eta);
        let wi = match (is_reflection, is_flat) {
            (true, true) => reflect(wo),
            (true, false) => (m * (2.0 * cos) - wo).normalize_or(m),
            (false, _) => fresnel::refract(wo, m, eta)?,
        };
        if same_hemisphere(wo, wi) != is_reflection || wi.z == 0.0 {
            return None;
        }
        // The Fresnel reflectance cancels with the probability of reflection.
        let masking = if is_flat { 1.0 } else { self.ggx.masking_ratio(wo, wi) };
        let weight = Vec3::splat(if is_reflection { masking } else { masking / (eta * eta) });
        let sample = if is_flat {
            BsdfSample::specular(wi, weight)
        } else {
            BsdfSample::glossy(wi, weight, self.pdf(wo, wi))
        };
        Some(if is_reflection { sample } else { BsdfSample { transmission: true, eta, ..sample } })
    }

    fn is_specular(&self) -> bool {
        self.is_flat()
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
    fn smooth_glass_refracts_by_snells_law_and_scales_radiance() {
        let glass = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
        let out = Vec3::new(0.3, 0.0, -(1.0 - 0.09f32).sqrt());
        let sample = glass.sample(out, 0.99, Vec2::ZERO).expect("below the critical angle");
        assert!((sample.wi.x + 0.45).abs() < 1e-5 && sample.wi.z > 0.0);
        assert!((sample.eta - 1.0 / 1.5).abs() < 1e-6 && (sample.weight.x - 2.25).abs() < 1e-5);
    }

    #[test]
    fn total_internal_reflection_is_always_sampled_as_reflection() {
        let glass = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
        let out = Vec3::new(0.9, 0.0, -(1.0 - 0.81f32).sqrt());
        let sample = glass.sample(out, 0.999_999, Vec2::ZERO).expect("it is reflected");
        assert!(!sample.transmission && sample.weight == Vec3::ONE);
    }

    #[test]
    fn a_rough_boundary_between_equal_indices_transmits_unchanged() {
        let air = Dielectric { eta: 1.0, ggx: Ggx::new(0.5, 0.5) };
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let sample = air.sample(wo, 0.0, Vec2::ZERO).expect("it transmits");
        assert!(air.is_specular() && (sample.wi + wo).length() < 1e-6);
    }
}
