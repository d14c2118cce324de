//! Sums of scattering models: the additive materials of pbrt-v2 and v3 (`plastic`, `uber`, `translucent`,
//! `glass`).
//!
//! As in pbrt, nothing keeps the sum of the albedos below 1; the scene has to.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::diffuse::Diffuse;
use super::microfacet_lobe::MicrofacetLobe;
use super::null_transmission::NullTransmission;
use super::tinted_dielectric::TintedDielectric;

/// The sum of up to four lobes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BxdfSum {
    pub diffuse: Option<Diffuse>,
    pub microfacet: Option<MicrofacetLobe>,
    pub dielectric: Option<TintedDielectric>,
    pub null: Option<NullTransmission>,
}

/// Maximum number of lobes.
const LOBES: usize = 4;

fn as_bxdf<B: Bxdf>(lobe: &Option<B>) -> Option<&dyn Bxdf> {
    lobe.as_ref().map(|lobe| lobe as &dyn Bxdf)
}

impl BxdfSum {
    fn slots(&self) -> [Option<&dyn Bxdf>; LOBES] {
        [as_bxdf(&self.diffuse), as_bxdf(&self.microfacet), as_bxdf(&self.dielectric), as_bxdf(&self.null)]
    }

    fn lobes(&self) -> impl Iterator<Item = &dyn Bxdf> {
        self.slots().into_iter().flatten()
    }

    /// Probabilities of sampling the lobes, in proportion to their albedos' brightest channels. They sum to 1,
    /// or to 0 if nothing scatters.
    fn probabilities(&self, wo: Vec3) -> [f32; LOBES] {
        let albedos =
            self.slots().map(|slot| slot.map_or(0.0, |lobe| lobe.albedo(wo).max_element().max(0.0)));
        let sum: f32 = albedos.iter().sum();
        if sum > 0.0 { albedos.map(|albedo| albedo / sum) } else { albedos }
    }
}

impl Bxdf for BxdfSum {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.lobes().map(|lobe| lobe.eval(wo, wi)).sum()
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let slots = self.slots().into_iter().zip(self.probabilities(wo)).filter(|(_, p)| *p > 0.0);
        slots.map(|(slot, p)| slot.map_or(0.0, |lobe| p * lobe.pdf(wo, wi))).sum()
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        // Choose a lobe and rescale `u_lobe` to [0, 1) for it
        let probabilities = self.probabilities(wo);
        let mut rest = u_lobe;
        let last = probabilities.iter().rposition(|&p| p > 0.0)?;
        let chosen = (0..last).find(|&i| {
            let is_chosen = rest < probabilities[i];
            if !is_chosen {
                rest -= probabilities[i];
            }
            is_chosen
        });
        let chosen = chosen.unwrap_or(last);
        let u_rescaled = (rest / probabilities[chosen]).clamp(0.0, 1.0 - f32::EPSILON);

        // Sample the lobe and evaluate all of them
        let sample = self.slots()[chosen]?.sample(wo, u_rescaled, u)?;
        if sample.specular {
            return Some(BsdfSample { weight: sample.weight / probabilities[chosen], ..sample });
        }
        let pdf = self.pdf(wo, sample.wi);
        (pdf > 0.0).then(|| BsdfSample { weight: self.eval(wo, sample.wi) / pdf, pdf, ..sample })
    }

    fn is_specular(&self) -> bool {
        self.lobes().next().is_some() && self.lobes().all(|lobe| lobe.is_specular())
    }

    fn transmits(&self) -> bool {
        // Specular lobes transmit no light that is sampled
        self.lobes().any(|lobe| !lobe.is_specular() && lobe.transmits())
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        self.lobes().map(|lobe| lobe.albedo(wo)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specular_lobes_are_sampled_with_their_probability_and_keep_their_energy() {
        let black = Vec3::ZERO;
        let diffuse = Diffuse { reflectance: Vec3::splat(0.6), transmittance: black };
        let null = Some(NullTransmission(Vec3::splat(0.2)));
        let sum = BxdfSum { diffuse: Some(diffuse), null, ..BxdfSum::default() };
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let below = sum.sample(wo, 0.7499, Vec2::splat(0.3)).unwrap();
        assert!(!below.specular && below.wi.z > 0.0);
        let above = sum.sample(wo, 0.7501, Vec2::splat(0.3)).unwrap();
        assert!(above.specular && above.transmission && above.wi == -wo);
        assert!((above.weight.x - 0.2 / 0.25).abs() < 1e-5);
        assert!(!sum.transmits() && !sum.is_specular());
    }

    #[test]
    fn an_empty_sum_scatters_nothing() {
        let sum = BxdfSum::default();
        assert!(sum.sample(Vec3::Z, 0.5, Vec2::splat(0.5)).is_none());
        assert_eq!(sum.pdf(Vec3::Z, Vec3::Z), 0.0);
    }
}
