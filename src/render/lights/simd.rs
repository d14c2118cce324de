//! Light sampling at many points in SIMD: the kernels that evaluate or sample one light for all lanes of a mask.

#![expect(clippy::needless_range_loop, reason = "several arrays are indexed by lane at once")]

use glam::{Vec2, Vec3};

use super::light_bounds::LightBounds;
use super::light_sample::LightSamples;
use super::light_sample_context::LightSampleContexts;
use super::light_tree::ONE_MINUS_EPSILON;
use super::uniform_sphere::{UNIFORM_SPHERE_PDF, sample_uniform_sphere};
use super::uniform_triangle_light::{UniformTriangleLight, sample_triangle_point};
use crate::geometry::TriangleSampler;
use crate::simd::{LANES, Lanes, Lanes3, apply, lane_mask, multiversioned};

/// Irradiance from all finite lights at every point; see `LightSampler::finite_irradiance`.
#[apply(multiversioned!)]
pub fn finite_irradiances(bounds: &[LightBounds], contexts: &LightSampleContexts, irradiances: &mut Lanes) {
    *irradiances = [0.0; LANES];
    let Some((all, parts)) = bounds.split_first() else { return };
    for part in parts {
        let part = *part;
        for lane in 0..LANES {
            irradiances[lane] += part.importance(&contexts.at(lane));
        }
    }
    let all = *all;
    for lane in 0..LANES {
        irradiances[lane] = irradiances[lane].max(all.importance(&contexts.at(lane)));
    }
}

/// The lanes that choose each child of a node of the light tree; the others, whose points neither can illuminate, choose
/// none.
pub struct ChoiceOfChild {
    pub first: u32,
    pub second: u32,
}

/// Chooses one of two bounds of lights by their importance in the lanes of a mask, by `u` in [0, 1). Multiplies the
/// probabilities by that of the choice, and leaves in `u` a number in [0, 1) for the next one.
#[apply(multiversioned!)]
pub fn choose_children(
    mask: u32,
    children: [&LightBounds; 2],
    contexts: &LightSampleContexts,
    u: &mut Lanes,
    probability: &mut Lanes,
) -> ChoiceOfChild {
    let [first, second] = children.map(|bounds| *bounds);
    let (mut is_first, mut is_second) = ([0u32; LANES], [0u32; LANES]);
    for lane in 0..LANES {
        let context = contexts.at(lane);
        let importance = first.importance(&context);
        let sum = importance + second.importance(&context);
        let p_first = importance / sum;
        let takes_first = u[lane] < p_first;
        let (to_first, to_second) = (u[lane] / p_first, (u[lane] - p_first) / (1.0 - p_first));
        let to_second = if to_second < ONE_MINUS_EPSILON { to_second } else { ONE_MINUS_EPSILON };
        let is_on = (mask >> lane & 1 == 1) & (sum > 0.0);
        is_first[lane] = u32::from(is_on & takes_first);
        is_second[lane] = u32::from(is_on & !takes_first);
        let (next, p) = if takes_first { (to_first, p_first) } else { (to_second, 1.0 - p_first) };
        u[lane] = if is_on { next } else { u[lane] };
        probability[lane] *= if is_on { p } else { 1.0 };
    }
    ChoiceOfChild {
        first: lane_mask(|lane| is_first[lane] != 0),
        second: lane_mask(|lane| is_second[lane] != 0),
    }
}

/// Samples an environment of constant radiance in the lanes of a mask.
#[apply(multiversioned!)]
pub fn sample_constant_environment(mask: u32, radiance: Vec3, u: &[Lanes; 2], samples: &mut LightSamples) {
    let [u_x, u_y] = u;
    for lane in 0..LANES {
        let wi = sample_uniform_sphere(Vec2::new(u_x[lane], u_y[lane]));
        let is_on = mask >> lane & 1 == 1;
        samples.wi.set_if(lane, is_on, wi);
        samples.radiance.set_if(lane, is_on, radiance);
        samples.pdf[lane] = if is_on { UNIFORM_SPHERE_PDF } else { samples.pdf[lane] };
        samples.can_be_hit[lane] = if is_on { 1 } else { samples.can_be_hit[lane] };
        samples.has_target[lane] = if is_on { 0 } else { samples.has_target[lane] };
    }
}

/// Samples points of a triangle light in the lanes of a mask.
#[apply(multiversioned!)]
pub fn sample_uniform_triangle(
    mask: u32,
    light: &UniformTriangleLight,
    shape: &TriangleSampler,
    references: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut LightSamples,
) {
    let [u_x, u_y] = u;
    let UniformTriangleLight { radiance, two_sided, can_be_hit, .. } = *light;
    let can_be_hit = u32::from(can_be_hit);
    for lane in 0..LANES {
        let u = Vec2::new(u_x[lane], u_y[lane]);
        let sample = sample_triangle_point(shape, two_sided, references.at(lane), u);
        let is_on = mask >> lane & 1 == 1;
        samples.wi.set_if(lane, is_on, sample.wi);
        samples.radiance.set_if(lane, is_on, radiance);
        samples.pdf[lane] = if is_on { sample.pdf } else { samples.pdf[lane] };
        samples.target.set_if(lane, is_on, sample.target);
        samples.can_be_hit[lane] = if is_on { can_be_hit } else { samples.can_be_hit[lane] };
        samples.has_target[lane] = if is_on { 1 } else { samples.has_target[lane] };
    }
}

#[cfg(test)]
mod tests;
