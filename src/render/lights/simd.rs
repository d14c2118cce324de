//! Light sampling at many points in SIMD: the kernels that evaluate or sample one light for all lanes of a mask.

#![expect(clippy::needless_range_loop, reason = "several arrays are indexed by lane at once")]

use glam::{Vec2, Vec3};

use super::light_bounds::LightBounds;
use super::light_sample::LightSamples;
use super::light_sample_context::LightSampleContexts;
use super::uniform_sphere::{UNIFORM_SPHERE_PDF, sample_uniform_sphere};
use super::uniform_triangle_light::{UniformTriangleLight, sample_triangle_point};
use crate::geometry::TriangleSampler;
use crate::simd::{LANES, Lanes, Lanes3, apply, multiversioned};

/// Importance of bounds of lights at every point.
#[apply(multiversioned!)]
pub fn importances(bounds: &LightBounds, contexts: &LightSampleContexts, importances: &mut Lanes) {
    let bounds = *bounds;
    for lane in 0..LANES {
        importances[lane] = bounds.importance(&contexts.at(lane));
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
