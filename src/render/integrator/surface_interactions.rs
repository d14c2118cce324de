//! Surface interactions of a packet: SIMD materials in lanes, all others one by one.

use glam::Vec3;

use super::scalar_interaction::{ScalarInteraction, scalar_lanes};
use crate::geometry::{InteractionLanes, RayLanes, SurfaceInteraction, face_forward};
use crate::render::bsdf::{Bsdf, BsdfSamples, BsdfValues, SimdBsdfs};
use crate::render::lights::LightSampleContexts;
use crate::render::sampler::BounceSamples;
use crate::simd::{LANES, Lanes3, apply, multiversioned};

/// Where the paths of a packet hit surfaces, and how these scatter light.
pub struct SurfaceInteractions<'t, 's> {
    pub points: InteractionLanes,
    /// Shading normals after bump or normal maps.
    pub normals: Lanes3,
    /// Lanes with SIMD materials.
    pub simd: u32,
    pub simd_bsdfs: SimdBsdfs<'t>,
    /// All other lanes.
    pub scalar: Vec<ScalarInteraction<'s>>,
    /// The interactions as light sampling sees them.
    pub contexts: LightSampleContexts,
}

impl SurfaceInteractions<'_, '_> {
    /// Returns a lane's interaction, given the primitive that was hit.
    pub fn at(&self, lane: usize, primitive: u32) -> SurfaceInteraction {
        let scalar = self.scalar_at(lane);
        scalar.map_or_else(|| self.points.at(lane, primitive), |scalar| scalar.point)
    }

    /// Returns a lane's BSDF unless it is a SIMD material's.
    pub fn scalar_bsdf(&self, lane: usize) -> Option<&Bsdf<'_>> {
        self.scalar_at(lane).and_then(|scalar| scalar.bsdf.as_ref())
    }

    fn scalar_at(&self, lane: usize) -> Option<&ScalarInteraction<'_>> {
        self.scalar.iter().find(|scalar| scalar.lane == lane)
    }

    /// Evaluates the BSDFs in a mask's lanes for light from `wi`.
    #[inline]
    pub fn eval_bsdfs(&self, mask: u32, rays: &RayLanes, wi: &Lanes3, values: &mut BsdfValues) {
        self.simd_bsdfs.eval(mask & self.simd, rays, &self.normals, wi, values);
        for ScalarInteraction { lane, bsdf, .. } in scalar_lanes(&self.scalar, mask) {
            let wo = -rays.direction.at(*lane);
            let value = bsdf.as_ref().map(|bsdf| bsdf.eval_and_pdf(wo, wi.at(*lane)));
            values.set(*lane, value.unwrap_or((Vec3::ZERO, 0.0)));
        }
    }

    /// Samples the BSDFs in a mask's lanes.
    #[inline]
    pub fn sample_bsdfs(
        &self,
        mask: u32,
        rays: &RayLanes,
        samples: &BounceSamples,
        scattered: &mut BsdfSamples,
    ) {
        self.simd_bsdfs.sample(mask & self.simd, rays, &self.normals, &samples.bsdf_uv, scattered);
        for ScalarInteraction { lane, bsdf, .. } in scalar_lanes(&self.scalar, mask) {
            let wo = -rays.direction.at(*lane);
            let u = samples.bsdf_uv_at(*lane);
            scattered.set(*lane, bsdf.as_ref().and_then(|bsdf| bsdf.sample(wo, samples.lobe[*lane], u)));
        }
    }

    /// Sets the light sampling contexts' positions and normals, on the viewer's side of the surfaces: a surface
    /// that is itself a light is then not seen from its other side.
    #[inline]
    pub fn set_contexts(&mut self, rays: &RayLanes) {
        light_sampling_contexts(rays, &self.points, &self.normals, &mut self.contexts);
    }
}

#[apply(multiversioned!)]
fn light_sampling_contexts(
    rays: &RayLanes,
    points: &InteractionLanes,
    normals: &Lanes3,
    contexts: &mut LightSampleContexts,
) {
    for lane in 0..LANES {
        let wo = -rays.direction.at(lane);
        contexts.position.set(lane, points.offset_origin(lane, wo));
        contexts.normal.set(lane, face_forward(normals.at(lane), wo));
    }
}
