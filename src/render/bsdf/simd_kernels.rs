//! SIMD kernels that evaluate or sample one model for all lanes of a mask.

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSamples;
use super::bsdf_values::BsdfValues;
use super::bxdf::Bxdf;
use super::conductor::Conductor;
use super::diffuse::Diffuse;
use super::directions::{
    cosine_hemisphere_pdf, on_horizon, same_hemisphere, sample_cosine_hemisphere, to_hemisphere_of,
};
use super::fresnel;
use super::shading_frame::ShadingFrame;
use crate::simd::{LANES, Lanes, Lanes3, apply, multiversioned};

/// Evaluates diffuse reflection. `directions` are those of the rays towards the surfaces, unit and in render space.
#[apply(multiversioned!)]
pub(super) fn eval_diffuse(
    mask: u32,
    reflectance: &Lanes3,
    directions: &Lanes3,
    normals: &Lanes3,
    wi: &Lanes3,
    values: &mut BsdfValues,
) {
    for lane in 0..LANES {
        let normal = normals.at(lane);
        // Diffuse reflection depends on the cosines alone.
        let [wo, wi] = [-directions.at(lane), wi.at(lane)].map(|w| Vec3::new(0.0, 0.0, w.dot(normal)));
        let diffuse = Diffuse { reflectance: reflectance.at(lane), transmittance: Vec3::ZERO };
        let is_valid = !on_horizon(wo) & !on_horizon(wi) & same_hemisphere(wo, wi);
        let value = if is_valid { diffuse.eval(wo, wi) } else { Vec3::ZERO };
        let pdf = if is_valid { cosine_hemisphere_pdf(wi) } else { 0.0 };
        let is_on = mask >> lane & 1 == 1;
        values.value.set_if(lane, is_on, value);
        values.pdf[lane] = if is_on { pdf } else { values.pdf[lane] };
    }
}

/// Evaluates a rough conductor. `directions` are those of the rays towards the surfaces.
#[apply(multiversioned!)]
pub(super) fn eval_conductor(
    mask: u32,
    conductor: &Conductor,
    directions: &Lanes3,
    normals: &Lanes3,
    wi: &Lanes3,
    values: &mut BsdfValues,
) {
    let Conductor { eta, k, ggx } = *conductor;
    for lane in 0..LANES {
        let frame = ShadingFrame::from_normal(normals.at(lane));
        let (wo, wi) = (frame.to_local(-directions.at(lane)), frame.to_local(wi.at(lane)));
        let (reflection, cos) = ggx.reflection_eval(wo, wi);
        let value = fresnel::conductor(cos, eta, k) * reflection;
        let pdf = ggx.reflection_pdf(wo, wi);
        let is_valid = !on_horizon(wo) & !on_horizon(wi) & same_hemisphere(wo, wi);
        let is_on = mask >> lane & 1 == 1;
        values.value.set_if(lane, is_on, if is_valid { value } else { Vec3::ZERO });
        let pdf = if is_valid { pdf } else { 0.0 };
        values.pdf[lane] = if is_on { pdf } else { values.pdf[lane] };
    }
}

/// Samples diffuse reflection by `u` in [0, 1)². `directions` are those of the rays towards the surfaces.
#[apply(multiversioned!)]
pub(super) fn sample_diffuse(
    mask: u32,
    reflectance: &Lanes3,
    directions: &Lanes3,
    normals: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut BsdfSamples,
) {
    let [u_x, u_y] = u;
    for lane in 0..LANES {
        let frame = ShadingFrame::from_normal(normals.at(lane));
        let wo = frame.to_local(-directions.at(lane));
        let wi = to_hemisphere_of(sample_cosine_hemisphere(Vec2::new(u_x[lane], u_y[lane])), wo);
        let is_valid = !on_horizon(wo) & !on_horizon(wi);
        let is_on = mask >> lane & 1 == 1;
        samples.wi.set_if(lane, is_on, frame.to_render(wi).normalize());
        samples.weight.set_if(lane, is_on, if is_valid { reflectance.at(lane) } else { Vec3::ZERO });
        samples.pdf[lane] = if is_on { cosine_hemisphere_pdf(wi) } else { samples.pdf[lane] };
    }
}

/// Samples a rough conductor by `u` in [0, 1)². `directions` are those of the rays towards the surfaces.
#[apply(multiversioned!)]
pub(super) fn sample_conductor(
    mask: u32,
    conductor: &Conductor,
    directions: &Lanes3,
    normals: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut BsdfSamples,
) {
    let [u_x, u_y] = u;
    let Conductor { eta, k, ggx } = *conductor;
    for lane in 0..LANES {
        let frame = ShadingFrame::from_normal(normals.at(lane));
        let wo = frame.to_local(-directions.at(lane));
        let reflection = ggx.sample_unchecked_reflection(wo, Vec2::new(u_x[lane], u_y[lane]));
        let wi = reflection.wi;
        let pdf = ggx.reflection_pdf(wo, wi);
        let weight = fresnel::conductor(reflection.cos, eta, k) * reflection.weight;
        let is_valid = !on_horizon(wo) & !on_horizon(wi) & same_hemisphere(wo, wi) & (pdf > 0.0);
        let is_on = mask >> lane & 1 == 1;
        samples.wi.set_if(lane, is_on, frame.to_render(wi).normalize());
        samples.weight.set_if(lane, is_on, if is_valid { weight } else { Vec3::ZERO });
        samples.pdf[lane] = if is_on { pdf } else { samples.pdf[lane] };
    }
}
