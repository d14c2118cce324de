//! A rough microfacet lobe (Torrance and Sparrow 1967): the glossy part of pbrt-v2's and v3's `plastic`, `uber`,
//! `translucent` and `metal` materials.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::directions::same_hemisphere;
use super::fresnel;
use super::microfacet_distribution::MicrofacetDistribution;

/// The Fresnel reflectance of microfacets (pbrt-v3's `Fresnel`).
#[derive(Clone, Copy, Debug)]
pub(super) enum MicrofacetFresnel {
    /// Index of refraction of the far side over that of the near side, seen from the front and from behind. It is below 1 for
    /// the front of pbrt-v2's and v3's `plastic`, which reflects everything beyond the critical angle.
    Dielectric {
        front: f32,
        back: f32,
    },
    Conductor {
        eta: Vec3,
        k: Vec3,
    },
}

impl MicrofacetFresnel {
    /// The reflectance for light from the side of `wo`.
    fn reflectance(self, wo: Vec3, cos: f32) -> Vec3 {
        match self {
            Self::Dielectric { front, back } => {
                Vec3::splat(fresnel::dielectric(cos, if wo.z < 0.0 { back } else { front }))
            }
            Self::Conductor { eta, k } => fresnel::conductor(cos, eta, k),
        }
    }
}

/// Glossy reflection, and glossy transmission as its mirror image below the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct MicrofacetLobe {
    pub reflectance: Vec3,
    pub transmittance: Vec3,
    pub distribution: MicrofacetDistribution,
    pub fresnel: MicrofacetFresnel,
}

impl MicrofacetLobe {
    fn reflection_probability(&self) -> f32 {
        let (r, t) = (self.reflectance.max_element(), self.transmittance.max_element());
        if r + t > 0.0 { r / (r + t) } else { 0.0 }
    }

    /// The colour of the hemisphere of `wi`, and `wi` mirrored to the hemisphere of `wo`.
    fn as_reflection(&self, wo: Vec3, wi: Vec3) -> (Vec3, Vec3) {
        if same_hemisphere(wo, wi) { (self.reflectance, wi) } else { (self.transmittance, mirrored(wi)) }
    }
}

/// The mirror image of a direction below the surface's plane.
fn mirrored(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

impl Bxdf for MicrofacetLobe {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let (colour, wi) = self.as_reflection(wo, wi);
        if colour == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let (value, cos) = self.distribution.reflection_eval(wo, wi);
        colour * self.fresnel.reflectance(wo, cos) * value
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let p_reflection = self.reflection_probability();
        let p = if same_hemisphere(wo, wi) { p_reflection } else { 1.0 - p_reflection };
        if p == 0.0 {
            return 0.0;
        }
        p * self.distribution.reflection_pdf(wo, self.as_reflection(wo, wi).1)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let is_reflection = u_lobe < self.reflection_probability();
        let wi = self.distribution.sample_reflection(wo, u)?;
        let wi = if is_reflection { wi } else { mirrored(wi) };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample {
            transmission: !is_reflection,
            ..BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf)
        })
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn transmits(&self) -> bool {
        self.transmittance != Vec3::ZERO
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        (self.reflectance + self.transmittance) * self.fresnel.reflectance(wo, wo.z.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::super::blinn::Blinn;
    use super::*;

    #[test]
    fn a_lobe_has_the_index_of_the_side_that_it_is_seen_from() {
        let lobe = MicrofacetLobe {
            reflectance: Vec3::ONE,
            transmittance: Vec3::ZERO,
            distribution: MicrofacetDistribution::Blinn(Blinn::new(200.0, 200.0)),
            fresnel: MicrofacetFresnel::Dielectric { front: 1.0 / 1.5, back: 1.5 },
        };
        let wo = Vec3::new(0.8, 0.0, 0.6);
        assert_eq!(lobe.albedo(wo), Vec3::ONE, "beyond the critical angle");
        assert_eq!(lobe.albedo(-wo), Vec3::splat(fresnel::dielectric(0.6, 1.5)));
        let mirrored = |w: Vec3| Vec3::new(-w.x, 0.0, w.z);
        let ratio = lobe.eval(-wo, mirrored(-wo)) / lobe.eval(wo, mirrored(wo));
        assert!((ratio.x - fresnel::dielectric(0.6, 1.5)).abs() < 1e-5, "{ratio}");
    }
}
