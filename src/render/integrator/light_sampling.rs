//! Light sampling (next-event estimation): each path samples a light at its surface interaction, weighted
//! against BSDF sampling by the power heuristic (Veach 1997, chapter 9), and gains its light if the shadow ray
//! is unoccluded.

#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays at once")]

use super::mis::power_heuristic;
use super::path_packet::PathPacket;
use super::path_tracer::{MAX_INTERFACES, PathTracer};
use super::shadow_ray_queue::ShadowRayQueue;
use super::surface_interactions::SurfaceInteractions;
use super::wavefront::record_slot;
use crate::geometry::{InteractionLanes, Ray};
use crate::render::bsdf::BsdfValues;
use crate::render::lights::LightSamples;
use crate::render::sample_records::SampleRecords;
use crate::render::sampler::BounceSamples;
use crate::simd::{LANES, Lanes, apply, lane_mask, lanes_in, multiversioned};

impl PathTracer<'_> {
    /// Samples a light for each path in a mask's lanes and queues the shadow rays. A full queue is tested for
    /// occlusion.
    pub(super) fn sample_lights(
        &self,
        mask: u32,
        packet: &PathPacket,
        interactions: &SurfaceInteractions,
        samples: &BounceSamples,
        shadow_rays: &mut ShadowRayQueue,
        records: &mut [SampleRecords],
    ) {
        if mask == 0 {
            return;
        }
        let mut lights = LightSamples::NONE;
        self.lights.sample(
            mask,
            &interactions.contexts,
            &samples.light_choice,
            &samples.light_uv,
            &mut lights,
        );
        let mut bsdfs = BsdfValues::ZERO;
        interactions.eval_bsdfs(mask, &packet.rays, &lights.wi, &mut bsdfs);
        let mut sampled = ShadowRayQueue::EMPTY;
        let lit = compute_shadow_rays(mask, packet, &interactions.points, &lights, &bsdfs, &mut sampled);
        for lane in lanes_in(lit) {
            shadow_rays.push(packet.path[lane], &sampled, lane);
            if shadow_rays.count == LANES {
                self.add_unoccluded_light(shadow_rays, records);
            }
        }
    }

    /// Empties the shadow-ray queue and adds the radiance of unoccluded rays to the paths' records.
    pub(super) fn add_unoccluded_light(
        &self,
        shadow_rays: &mut ShadowRayQueue,
        records: &mut [SampleRecords],
    ) {
        let count = std::mem::take(&mut shadow_rays.count);
        if count == 0 {
            return;
        }
        let all = (1 << count) - 1;
        let unoccluded = if self.has_interfaces {
            let is_unoccluded = |lane: &usize| self.is_unoccluded(shadow_rays.rays.at(*lane));
            (0..count).filter(is_unoccluded).fold(0, |mask, lane| mask | 1 << lane)
        } else {
            all & !self.accel.occluded_lanes(&shadow_rays.rays, count)
        };
        for lane in lanes_in(unoccluded) {
            let (record, slot) = record_slot(shadow_rays.path[lane]);
            let sum = &mut records[record].light_sampled;
            sum.set(slot, sum.at(slot) + shadow_rays.radiance.at(lane));
        }
    }

    /// Returns whether a shadow ray meets no surface but interfaces.
    pub(super) fn is_unoccluded(&self, mut ray: Ray) -> bool {
        let end = ray.origin + ray.direction * ray.t_max;
        for _ in 0..MAX_INTERFACES {
            let Some(hit) = self.accel.intersect(&ray) else { return true };
            let point = self.accel.interaction(&ray, &hit);
            if !self.is_interface(&point) {
                return false;
            }
            ray.origin = point.offset_origin(ray.direction);
            if ray.t_max.is_finite() {
                ray.direction = end - ray.origin;
                ray.t_max = 1.0;
            }
        }
        false
    }
}

/// Computes the shadow ray of each lane and the radiance that its path gains if it is unoccluded. Returns the
/// lanes of `mask` in which the radiance is not 0.
#[apply(multiversioned!)]
fn compute_shadow_rays(
    mask: u32,
    packet: &PathPacket,
    points: &InteractionLanes,
    lights: &LightSamples,
    bsdfs: &BsdfValues,
    shadow_rays: &mut ShadowRayQueue,
) -> u32 {
    let mut is_lit: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        let scattered = bsdfs.value.at(lane) * lights.radiance.at(lane);
        let light_pdf = lights.pdf[lane];
        let power = power_heuristic(light_pdf, bsdfs.pdf[lane]);
        let weight = if lights.can_be_hit[lane] != 0 { power } else { 1.0 };
        shadow_rays.radiance.set(lane, packet.throughput.at(lane) * (scattered * (weight / light_pdf)));
        let origin = points.offset_origin(lane, lights.wi.at(lane));
        let (direction, t_max) = lights.shadow_ray(lane, origin);
        shadow_rays.rays.origin.set(lane, origin);
        shadow_rays.rays.direction.set(lane, direction);
        shadow_rays.rays.t_max[lane] = t_max;
        shadow_rays.rays.time[lane] = packet.rays.time[lane];
        let is_black = (scattered.x == 0.0) & (scattered.y == 0.0) & (scattered.z == 0.0);
        is_lit[lane] = u32::from(!is_black & (light_pdf > 0.0));
    }
    mask & lane_mask(|lane| is_lit[lane] != 0)
}
