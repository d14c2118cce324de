//! Chooses one light at a point with a probability in proportion to its estimated irradiance there: one of
//! the infinite lights, or one from the light tree, which holds all others.
//!
//! Takes the [`EmissionBounds`] of all lights once, then a [`LightSampleContext`] and a sample value for each
//! choice; gives the index of a light and the discrete probability of choosing it. Unlike pbrt-v4's
//! `BVHLightSampler` (section 12.6.3), which gives all infinite lights and the tree the same probability,
//! these are weighted by irradiance too.

use glam::Vec3;

use super::angle::Angle;
use super::emission_bounds::EmissionBounds;
use super::light_bounds::LightBounds;
use super::light_sample_context::{LightSampleContext, LightSampleContexts};
use super::light_tree::{ChosenLights, LightTree, ONE_MINUS_EPSILON};
use crate::simd::{Lanes, lanes_in};

/// Fraction of the choices between infinite lights and the tree that is uniform, since the estimated
/// irradiance ignores occlusion.
const UNIFORM_FRACTION: f32 = 0.1;

/// Number of parts by which the irradiance of all finite lights is estimated, at most. One sphere around lamps that are far apart
/// says little of the irradiance beside one of them.
const MAX_PARTS: usize = 8;

/// Chooses among lights, which are numbered in the order given to [`Self::new`].
pub struct LightSampler {
    infinite: Vec<InfiniteLight>,
    tree: LightTree,
    /// Bounds of all finite lights together, then bounds of parts of them; none without an infinite light, whose probabilities
    /// depend on them.
    finite_bounds: Vec<LightBounds>,
}

/// A choice among the infinite lights and the tree.
enum InfiniteChoice {
    /// An infinite light and its probability; `None` if no light can illuminate the point.
    Light(Option<(usize, f32)>),
    /// The tree, reached with a probability; `u` in [0, 1) chooses in it.
    Tree { u: f32, probability: f32 },
}

struct InfiniteLight {
    light: usize,
    direction: Option<Vec3>,
    irradiance: f32,
}

impl LightSampler {
    pub fn new(lights: impl Iterator<Item = EmissionBounds>) -> Self {
        let (mut infinite, mut finite) = (Vec::new(), Vec::new());
        for (light, bounds) in lights.enumerate() {
            finite.push(None);
            match bounds.non_zero() {
                Some(EmissionBounds::Finite(bounds)) => finite[light] = Some(bounds),
                Some(EmissionBounds::Infinite { direction, irradiance }) => {
                    infinite.push(InfiniteLight { light, direction, irradiance });
                }
                None => {}
            }
        }
        let tree = LightTree::new(&finite);
        let finite_bounds =
            if infinite.is_empty() { Vec::new() } else { [tree.cut(1), tree.cut(MAX_PARTS)].concat() };
        Self { infinite, tree, finite_bounds }
    }

    /// Number of lights whose probability is not 0 everywhere.
    pub fn len(&self) -> usize {
        self.infinite.len() + self.tree.len()
    }

    /// Bounds of all finite lights together, then bounds of parts of them; none without an infinite light.
    #[inline]
    pub fn finite_bounds(&self) -> &[LightBounds] {
        &self.finite_bounds
    }

    /// Estimated irradiance from all finite lights, 0 if there are none: the importance of all together, or the sum of those of
    /// their parts if it is larger. An estimate that is too large does less harm, since skies are hidden more often than lamps.
    #[inline]
    pub fn finite_irradiance(&self, context: &LightSampleContext) -> f32 {
        let Some((all, parts)) = self.finite_bounds.split_first() else { return 0.0 };
        let sum: f32 = parts.iter().map(|bounds| bounds.importance(context)).sum();
        all.importance(context).max(sum)
    }

    /// Chooses a light by `u` in [0, 1) and returns its index and probability; `None` if no light can
    /// illuminate the point. `finite` is [`Self::finite_irradiance`].
    #[inline]
    pub fn sample(&self, context: &LightSampleContext, finite: f32, u: f32) -> Option<(usize, f32)> {
        match self.sample_infinite(context, finite, u) {
            InfiniteChoice::Light(choice) => choice,
            InfiniteChoice::Tree { u, probability } => {
                let (light, in_tree) = self.tree.sample(context, u)?;
                Some((light, probability * in_tree))
            }
        }
    }

    /// As [`Self::sample`] in the lanes of a mask.
    pub fn sample_lanes(
        &self,
        mask: u32,
        contexts: &LightSampleContexts,
        finite: &Lanes,
        u: &Lanes,
    ) -> ChosenLights {
        let mut chosen = ChosenLights::NONE;
        if self.infinite.is_empty() {
            self.tree.sample_lanes(mask, contexts, u, &mut chosen);
            return chosen;
        }
        let (mut u_tree, mut p_tree, mut in_tree) = (*u, *u, 0);
        for lane in lanes_in(mask) {
            match self.sample_infinite(&contexts.at(lane), finite[lane], u[lane]) {
                InfiniteChoice::Light(Some((light, probability))) => chosen.set(lane, light, probability),
                InfiniteChoice::Light(None) => {}
                InfiniteChoice::Tree { u, probability } => {
                    (u_tree[lane], p_tree[lane]) = (u, probability);
                    in_tree |= 1 << lane;
                }
            }
        }
        self.tree.sample_lanes(in_tree, contexts, &u_tree, &mut chosen);
        for lane in lanes_in(in_tree & chosen.mask) {
            chosen.probability[lane] *= p_tree[lane];
        }
        chosen
    }

    /// Chooses among the infinite lights and the tree.
    #[inline]
    fn sample_infinite(&self, context: &LightSampleContext, finite: f32, mut u: f32) -> InfiniteChoice {
        if self.infinite.is_empty() {
            return InfiniteChoice::Tree { u, probability: 1.0 };
        }
        let probabilities = self.probabilities(context, finite);
        for infinite in &self.infinite {
            let probability = probabilities.for_irradiance(infinite.irradiance_at(context));
            if u < probability {
                return InfiniteChoice::Light(Some((infinite.light, probability)));
            }
            u -= probability;
        }
        let tree_probability = probabilities.for_irradiance(probabilities.finite);
        if tree_probability <= 0.0 {
            // Rounding has carried `u` past the last of the infinite lights.
            let last = self.infinite.iter().rev().map(|infinite| {
                (infinite.light, probabilities.for_irradiance(infinite.irradiance_at(context)))
            });
            return InfiniteChoice::Light(last.into_iter().find(|(_, probability)| *probability > 0.0));
        }
        InfiniteChoice::Tree {
            u: (u / tree_probability).min(ONE_MINUS_EPSILON),
            probability: tree_probability,
        }
    }

    /// Probability with which [`Self::sample`] chooses a light.
    #[inline]
    pub fn probability(&self, light: usize, context: &LightSampleContext, finite: f32) -> f32 {
        if self.infinite.is_empty() {
            return self.tree.probability(light, context);
        }
        let probabilities = self.probabilities(context, finite);
        match self.infinite.iter().find(|infinite| infinite.light == light) {
            Some(infinite) => probabilities.for_irradiance(infinite.irradiance_at(context)),
            None => {
                probabilities.for_irradiance(probabilities.finite) * self.tree.probability(light, context)
            }
        }
    }

    #[inline]
    fn probabilities(&self, context: &LightSampleContext, finite: f32) -> Probabilities {
        let infinite = self.infinite.iter().map(|infinite| infinite.irradiance_at(context));
        let (mut total, mut count) = (0.0, 0.0);
        for irradiance in infinite.chain([finite]).filter(|&e| e > 0.0) {
            total += irradiance;
            count += 1.0;
        }
        Probabilities {
            per_irradiance: (1.0 - UNIFORM_FRACTION) / total,
            uniform: UNIFORM_FRACTION / count,
            finite,
        }
    }
}

/// The linear function from estimated irradiance to probability at one point.
struct Probabilities {
    per_irradiance: f32,
    uniform: f32,
    /// Estimated irradiance from all finite lights.
    finite: f32,
}

impl Probabilities {
    #[inline]
    fn for_irradiance(&self, irradiance: f32) -> f32 {
        if irradiance > 0.0 { irradiance * self.per_irradiance + self.uniform } else { 0.0 }
    }
}

impl InfiniteLight {
    /// Estimated irradiance; 0 only if the light cannot illuminate the point.
    #[inline]
    fn irradiance_at(&self, context: &LightSampleContext) -> f32 {
        self.irradiance * self.direction.map_or(1.0, |direction| context.bound_cosine(direction, Angle::ZERO))
    }
}
