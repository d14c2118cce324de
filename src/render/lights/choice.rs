//! Which light is sampled at a point: one of those around the scene, or one from the tree of those
//! within it, by the irradiance to be expected.

use glam::Vec3;

use super::BELOW_ONE;
use super::bounds::{Angle, LightBounds, Receiver};
use super::tree::LightTree;

/// Share of the choices between lights around the scene and the tree that is even instead, since
/// the irradiance expected knows nothing of what stands in the way.
const EVEN_SHARE: f32 = 0.1;

/// What the choice of a light goes by.
#[derive(Clone, Copy, Debug)]
pub enum Reach {
    /// From within the scene.
    Within(LightBounds),
    /// From around the scene: the irradiance, which for parallel light is that of a surface facing
    /// the unit direction it comes from, else the mean over all orientations.
    Around { direction: Option<Vec3>, irradiance: f32 },
}

impl Reach {
    /// `None` for a light that sends nothing that could be counted.
    fn usable(self) -> Option<Self> {
        let (amount, finite) = match &self {
            Self::Within(bounds) => {
                (bounds.intensity, bounds.centre.is_finite() && bounds.radius.is_finite())
            }
            Self::Around { irradiance, .. } => (*irradiance, true),
        };
        (amount > 0.0 && amount.is_finite() && finite).then_some(self)
    }
}

/// Chooses among lights, which are known by their number.
pub struct LightChoice {
    /// Lights around the scene.
    around: Vec<Around>,
    tree: LightTree,
}

struct Around {
    light: usize,
    direction: Option<Vec3>,
    irradiance: f32,
}

impl LightChoice {
    pub fn new(lights: impl Iterator<Item = Reach>) -> Self {
        let (mut around, mut within) = (Vec::new(), Vec::new());
        for (light, reach) in lights.enumerate() {
            let reach = reach.usable();
            within.push(None);
            match reach {
                Some(Reach::Within(bounds)) => within[light] = Some(bounds),
                Some(Reach::Around { direction, irradiance }) => {
                    around.push(Around { light, direction, irradiance });
                }
                None => {}
            }
        }
        Self { around, tree: LightTree::new(&within) }
    }

    /// Number of lights that may be chosen.
    pub fn len(&self) -> usize {
        self.around.len() + self.tree.len()
    }

    /// Bounds of all lights within the scene, if what is to be expected of them makes a difference: there
    /// are others as well.
    #[inline]
    pub fn bounds_within(&self) -> Option<&LightBounds> {
        self.tree.bounds().filter(|_| !self.around.is_empty())
    }

    /// Irradiance to be expected from the lights within the scene, where that makes a difference: the
    /// importance of [`Self::bounds_within`], which is 0 if there are none.
    #[inline]
    pub fn expected_within(&self, receiver: &Receiver) -> f32 {
        self.bounds_within().map_or(0.0, |bounds| bounds.importance(receiver))
    }

    /// A light for a number in [0, 1), with its probability; `None` if none can reach the receiver.
    /// `within` is [`Self::expected_within`].
    #[inline]
    pub fn sample(&self, receiver: &Receiver, within: f32, mut u: f32) -> Option<(usize, f32)> {
        if self.around.is_empty() {
            return self.tree.sample(receiver, u);
        }
        let shares = self.shares(receiver, within);
        for around in &self.around {
            let share = shares.of(around.expected(receiver));
            if u < share {
                return Some((around.light, share));
            }
            u -= share;
        }
        let share = shares.of(shares.tree);
        if share <= 0.0 {
            // Rounding has carried the number past the last of the lights around.
            let last =
                self.around.iter().rev().map(|around| (around.light, shares.of(around.expected(receiver))));
            return last.into_iter().find(|(_, share)| *share > 0.0);
        }
        let (light, probability) = self.tree.sample(receiver, (u / share).min(BELOW_ONE))?;
        Some((light, share * probability))
    }

    /// Probability with which [`Self::sample`] chooses a light.
    #[inline]
    pub fn probability(&self, light: usize, receiver: &Receiver, within: f32) -> f32 {
        if self.around.is_empty() {
            return self.tree.probability(light, receiver);
        }
        let shares = self.shares(receiver, within);
        match self.around.iter().find(|around| around.light == light) {
            Some(around) => shares.of(around.expected(receiver)),
            None => shares.of(shares.tree) * self.tree.probability(light, receiver),
        }
    }

    #[inline]
    fn shares(&self, receiver: &Receiver, tree: f32) -> Shares {
        let around = self.around.iter().map(|around| around.expected(receiver));
        let (mut total, mut count) = (0.0, 0.0);
        for expected in around.chain([tree]).filter(|&e| e > 0.0) {
            total += expected;
            count += 1.0;
        }
        Shares { per_expected: (1.0 - EVEN_SHARE) / total, even: EVEN_SHARE / count, tree }
    }
}

/// How probabilities follow from expected irradiances.
struct Shares {
    per_expected: f32,
    even: f32,
    /// Irradiance expected from the tree.
    tree: f32,
}

impl Shares {
    #[inline]
    fn of(&self, expected: f32) -> f32 {
        if expected > 0.0 { expected * self.per_expected + self.even } else { 0.0 }
    }
}

impl Around {
    /// Irradiance to be expected; 0 only if there cannot be any.
    #[inline]
    fn expected(&self, receiver: &Receiver) -> f32 {
        self.irradiance * self.direction.map_or(1.0, |direction| receiver.cosine(direction, Angle::ZERO))
    }
}
