//! Sums of lobes: the materials of pbrt-v2 and v3, whose parts lie over one another as if each
//! were alone. Nothing keeps their sum below 1; that is the scene's business, as it is there.

use glam::{Vec2, Vec3};

use super::dielectric::TintedDielectric;
use super::diffuse::Diffuse;
use super::gloss::Gloss;
use super::{BsdfSample, Scatter};

/// A part of a sum.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    Diffuse(Diffuse),
    Gloss(Gloss),
    Dielectric(TintedDielectric),
    /// Lets this much straight through.
    Straight(Vec3),
}

impl Part {
    fn scatter(&self) -> &dyn Scatter {
        match self {
            Part::Diffuse(lobe) => lobe,
            Part::Gloss(lobe) => lobe,
            Part::Dielectric(lobe) => lobe,
            Part::Straight(share) => share,
        }
    }
}

/// What lets light straight through.
impl Scatter for Vec3 {
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    fn pdf(&self, _wo: Vec3, _wi: Vec3) -> f32 {
        0.0
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        Some(BsdfSample { transmission: true, ..BsdfSample::specular(-wo, *self) })
    }

    fn is_specular(&self) -> bool {
        true
    }

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        *self
    }
}

/// Most parts of a sum.
const MAX_PARTS: usize = 4;

/// Lobes that add up.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    parts: [Option<Part>; MAX_PARTS],
}

impl Sum {
    /// The sum of at most [`MAX_PARTS`] parts.
    pub fn new(parts: [Option<Part>; MAX_PARTS]) -> Self {
        Self { parts }
    }

    fn lobes(&self) -> impl Iterator<Item = &dyn Scatter> {
        self.parts.iter().flatten().map(Part::scatter)
    }

    /// The parts' shares of the light, by the brightest channel; they add up to 1, unless nothing
    /// scatters.
    fn shares(&self, wo: Vec3) -> [f32; MAX_PARTS] {
        let weight = |part: &Option<Part>| {
            part.as_ref().map_or(0.0, |part| part.scatter().albedo(wo).max_element().max(0.0))
        };
        let weights = [0, 1, 2, 3].map(|i| weight(&self.parts[i]));
        let sum: f32 = weights.iter().sum();
        if sum > 0.0 { weights.map(|weight| weight / sum) } else { weights }
    }

    /// Whether a part takes light to the other side.
    pub fn transmits(&self) -> bool {
        self.parts.iter().flatten().any(|part| match part {
            Part::Diffuse(lobe) => lobe.transmittance != Vec3::ZERO,
            Part::Gloss(lobe) => lobe.transmittance != Vec3::ZERO,
            Part::Dielectric(_) | Part::Straight(_) => true,
        })
    }
}

impl Scatter for Sum {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.lobes().map(|lobe| lobe.eval(wo, wi)).sum()
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let shares = self.shares(wo);
        let parts = self.parts.iter().zip(shares).filter(|(_, share)| *share > 0.0);
        parts.map(|(part, share)| part.as_ref().map_or(0.0, |p| share * p.scatter().pdf(wo, wi))).sum()
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let shares = self.shares(wo);
        let mut rest = u_lobe;
        let last = shares.iter().rposition(|&share| share > 0.0)?;
        let chosen = (0..last).find(|&i| {
            let here = rest < shares[i];
            if !here {
                rest -= shares[i];
            }
            here
        });
        let chosen = chosen.unwrap_or(last);
        // What the choice leaves of the number is spread over [0, 1) again.
        let u_part = (rest / shares[chosen]).clamp(0.0, 1.0 - f32::EPSILON);
        let sample = self.parts[chosen].as_ref()?.scatter().sample(wo, u_part, u)?;
        if sample.specular {
            return Some(BsdfSample { weight: sample.weight / shares[chosen], ..sample });
        }
        let pdf = self.pdf(wo, sample.wi);
        (pdf > 0.0).then(|| BsdfSample { weight: self.eval(wo, sample.wi) / pdf, pdf, ..sample })
    }

    fn is_specular(&self) -> bool {
        self.lobes().all(|lobe| lobe.is_specular())
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        self.lobes().map(|lobe| lobe.albedo(wo)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specular_parts_are_drawn_by_their_share_and_keep_their_energy() {
        let black = Vec3::ZERO;
        let diffuse = Diffuse { reflectance: Vec3::splat(0.6), transmittance: black };
        let sum =
            Sum::new([Some(Part::Diffuse(diffuse)), Some(Part::Straight(Vec3::splat(0.2))), None, None]);
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let below = sum.sample(wo, 0.7499, Vec2::splat(0.3)).unwrap();
        assert!(!below.specular && below.wi.z > 0.0);
        let above = sum.sample(wo, 0.7501, Vec2::splat(0.3)).unwrap();
        assert!(above.specular && above.transmission && above.wi == -wo);
        assert!((above.weight.x - 0.2 / 0.25).abs() < 1e-5);
        assert!(sum.transmits() && !sum.is_specular());
    }

    #[test]
    fn an_empty_sum_scatters_nothing() {
        let sum = Sum::default();
        assert!(sum.sample(Vec3::Z, 0.5, Vec2::splat(0.5)).is_none());
        assert_eq!(sum.pdf(Vec3::Z, Vec3::Z), 0.0);
    }
}
