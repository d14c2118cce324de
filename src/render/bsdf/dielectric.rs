//! Glass: a boundary that reflects and refracts, smooth or of GGX microfacets, and a thin pane.
//!
//! Sources: Walter et al., *Microfacet models for refraction through rough surfaces* (2007),
//! equations 16, 17 and 21; pbrt-v4's rule that radiance is divided by the squared relative index
//! as it crosses.

use glam::{Vec2, Vec3};

use super::frame::{mirror, same_side};
use super::{BsdfSample, Scatter, fresnel, microfacet::Ggx};

/// A boundary between air above and `eta` below.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dielectric {
    pub eta: f32,
    pub ggx: Ggx,
}

impl Dielectric {
    /// Index of refraction of the side that `wo` is not on, over that of the side it is on.
    fn relative_eta(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Whether microfacets make no difference: there are none, or nothing bends at them.
    fn is_flat(&self) -> bool {
        self.ggx.is_smooth() || self.eta == 1.0
    }

    /// The microfacet, on `wo`'s side, that takes `wi` to `wo`; `None` if none can.
    fn microfacet(wo: Vec3, wi: Vec3, eta: f32) -> Option<Vec3> {
        let reflects = same_side(wo, wi);
        let m = if reflects { wo + wi } else { wo + wi * eta }.try_normalize()?;
        let m = if same_side(m, wo) { m } else { -m };
        (m.dot(wo) > 0.0 && (m.dot(wi) > 0.0) == reflects).then_some(m)
    }
}

/// |dm / dwi| of refraction at microfacet `m` (Walter et al., equation 17, with `eta` relative).
fn refraction_jacobian(wo: Vec3, wi: Vec3, m: Vec3, eta: f32) -> f32 {
    wi.dot(m).abs() / (wi.dot(m) + wo.dot(m) / eta).powi(2).max(f32::MIN_POSITIVE)
}

impl Scatter for Dielectric {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let eta = self.relative_eta(wo);
        if self.is_flat() {
            return Vec3::ZERO;
        }
        let Some(m) = Self::microfacet(wo, wi, eta) else { return Vec3::ZERO };
        let cos = wo.dot(m);
        let reflectance = fresnel::dielectric(cos, eta);
        let projected = self.ggx.projected(wo, wi, m);
        Vec3::splat(if same_side(wo, wi) {
            reflectance * projected / 4.0
        } else {
            (1.0 - reflectance) * projected * cos * refraction_jacobian(wo, wi, m, eta) / (eta * eta)
        })
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let eta = self.relative_eta(wo);
        if self.is_flat() {
            return 0.0;
        }
        let Some(m) = Self::microfacet(wo, wi, eta) else { return 0.0 };
        let reflectance = fresnel::dielectric(wo.dot(m), eta);
        if same_side(wo, wi) {
            reflectance * self.ggx.reflect_pdf(wo, wi)
        } else {
            (1.0 - reflectance) * self.ggx.visible_density(wo, m) * refraction_jacobian(wo, wi, m, eta)
        }
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let eta = self.relative_eta(wo);
        let flat = self.is_flat();
        let m = if flat { Vec3::new(0.0, 0.0, 1f32.copysign(wo.z)) } else { self.ggx.sample_visible(wo, u) };
        let cos = wo.dot(m);
        let reflects = u_lobe < fresnel::dielectric(cos, eta);
        let wi = match (reflects, flat) {
            (true, true) => mirror(wo),
            (true, false) => (m * (2.0 * cos) - wo).normalize_or(m),
            (false, _) => fresnel::refract(wo, m, eta)?,
        };
        if same_side(wo, wi) != reflects || wi.z == 0.0 {
            return None;
        }
        // Fresnel's factor is in the probability too, and cancels.
        let masking = if flat { 1.0 } else { self.ggx.masking_ratio(wo, wi) };
        let weight = Vec3::splat(if reflects { masking } else { masking / (eta * eta) });
        let sample = if flat {
            BsdfSample::specular(wi, weight)
        } else {
            BsdfSample::glossy(wi, weight, self.pdf(wo, wi))
        };
        Some(if reflects { sample } else { BsdfSample { transmission: true, eta, ..sample } })
    }

    fn is_specular(&self) -> bool {
        self.is_flat()
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        Vec3::ONE
    }
}

/// A boundary whose reflected and transmitted light is coloured: the `glass` of pbrt-v2 and v3.
#[derive(Clone, Copy, Debug)]
pub(super) struct TintedDielectric {
    pub boundary: Dielectric,
    pub reflected: Vec3,
    pub transmitted: Vec3,
}

impl TintedDielectric {
    fn tint(&self, transmission: bool) -> Vec3 {
        if transmission { self.transmitted } else { self.reflected }
    }
}

impl Scatter for TintedDielectric {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.tint(!same_side(wo, wi)) * self.boundary.eval(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.boundary.pdf(wo, wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sample = self.boundary.sample(wo, u_lobe, u)?;
        Some(BsdfSample { weight: self.tint(sample.transmission) * sample.weight, ..sample })
    }

    fn is_specular(&self) -> bool {
        self.boundary.is_specular()
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let reflectance = fresnel::dielectric(wo.z.abs(), self.boundary.relative_eta(wo));
        self.reflected * reflectance + self.transmitted * (1.0 - reflectance)
    }
}

/// A pane without thickness, its inner reflections summed; light that crosses goes straight on.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThinDielectric {
    pub eta: f32,
}

impl ThinDielectric {
    fn reflectance(&self, wo: Vec3) -> f32 {
        let once = fresnel::dielectric(wo.z.abs(), self.eta);
        // R + T²R + T²R³ + ... with T = 1 - R
        2.0 * once / (1.0 + once)
    }
}

impl Scatter for ThinDielectric {
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    fn pdf(&self, _wo: Vec3, _wi: Vec3) -> f32 {
        0.0
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let reflects = u_lobe < self.reflectance(wo);
        let wi = if reflects { mirror(wo) } else { -wo };
        Some(BsdfSample { transmission: !reflects, ..BsdfSample::specular(wi, Vec3::ONE) })
    }

    fn is_specular(&self) -> bool {
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
    fn a_pane_reflects_what_its_two_faces_do() {
        // 2 R / (1 + R) with R = 0.04
        let pane = ThinDielectric { eta: 1.5 };
        assert!((pane.reflectance(Vec3::Z) - 0.08 / 1.04).abs() < 1e-6);
        let through = pane.sample(Vec3::Z, 0.5, Vec2::ZERO).expect("a pane always scatters");
        assert!(through.transmission && through.wi == -Vec3::Z && through.eta == 1.0);
    }

    #[test]
    fn smooth_glass_refracts_by_snell_and_scales_radiance() {
        let glass = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
        let out = Vec3::new(0.3, 0.0, -(1.0 - 0.09f32).sqrt());
        let sample = glass.sample(out, 0.99, Vec2::ZERO).expect("below the critical angle");
        assert!((sample.wi.x + 0.45).abs() < 1e-5 && sample.wi.z > 0.0);
        assert!((sample.eta - 1.0 / 1.5).abs() < 1e-6 && (sample.weight.x - 2.25).abs() < 1e-5);
    }

    #[test]
    fn total_internal_reflection_leaves_nothing_to_refract() {
        let glass = Dielectric { eta: 1.5, ggx: Ggx::new(0.0, 0.0) };
        let out = Vec3::new(0.9, 0.0, -(1.0 - 0.81f32).sqrt());
        let sample = glass.sample(out, 0.999_999, Vec2::ZERO).expect("it is reflected");
        assert!(!sample.transmission && sample.weight == Vec3::ONE);
    }

    #[test]
    fn rough_glass_without_contrast_is_no_glass() {
        let air = Dielectric { eta: 1.0, ggx: Ggx::new(0.5, 0.5) };
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let sample = air.sample(wo, 0.0, Vec2::ZERO).expect("it goes straight on");
        assert!(air.is_specular() && (sample.wi + wo).length() < 1e-6);
    }
}
