//! Sums of lobes: the materials of pbrt-v2 and v3, whose parts lie over one another as if each
//! were alone. Nothing keeps their sum below 1; that is the scene's business, as it is there.

use glam::{Vec2, Vec3};

use super::dielectric::TintedDielectric;
use super::diffuse::Diffuse;
use super::gloss::Gloss;
use super::{BsdfSample, Scatter};

/// Lets this much straight through.
#[derive(Clone, Copy, Debug)]
pub(super) struct Straight(pub Vec3);

impl Scatter for Straight {
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

    fn albedo(&self, _wo: Vec3) -> Vec3 {
        self.0
    }
}

/// Lobes that add up.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    pub diffuse: Option<Diffuse>,
    pub gloss: Option<Gloss>,
    pub dielectric: Option<TintedDielectric>,
    pub straight: Option<Straight>,
}

/// Number of parts that a sum can have.
const PARTS: usize = 4;

/// A part as a lobe.
fn part<S: Scatter>(lobe: &Option<S>) -> Option<&dyn Scatter> {
    lobe.as_ref().map(|lobe| lobe as &dyn Scatter)
}

impl Sum {
    fn parts(&self) -> [Option<&dyn Scatter>; PARTS] {
        [part(&self.diffuse), part(&self.gloss), part(&self.dielectric), part(&self.straight)]
    }

    fn lobes(&self) -> impl Iterator<Item = &dyn Scatter> {
        self.parts().into_iter().flatten()
    }

    /// The parts' shares of the light, by the brightest channel; they add up to 1, unless nothing
    /// scatters.
    fn shares(&self, wo: Vec3) -> [f32; PARTS] {
        let weights =
            self.parts().map(|part| part.map_or(0.0, |lobe| lobe.albedo(wo).max_element().max(0.0)));
        let sum: f32 = weights.iter().sum();
        if sum > 0.0 { weights.map(|weight| weight / sum) } else { weights }
    }

    /// Whether a part takes light to the other side.
    pub fn transmits(&self) -> bool {
        self.diffuse.is_some_and(|lobe| lobe.transmittance != Vec3::ZERO)
            || self.gloss.is_some_and(|lobe| lobe.transmittance != Vec3::ZERO)
            || self.dielectric.is_some()
            || self.straight.is_some()
    }
}

impl Scatter for Sum {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.lobes().map(|lobe| lobe.eval(wo, wi)).sum()
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let parts = self.parts().into_iter().zip(self.shares(wo)).filter(|(_, share)| *share > 0.0);
        parts.map(|(part, share)| part.map_or(0.0, |lobe| share * lobe.pdf(wo, wi))).sum()
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
        let sample = self.parts()[chosen]?.sample(wo, u_part, u)?;
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
        let straight = Some(Straight(Vec3::splat(0.2)));
        let sum = Sum { diffuse: Some(diffuse), straight, ..Sum::default() };
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
