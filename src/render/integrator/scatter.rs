//! Scattering: samples the BSDFs of a packet's surface interactions and computes the scattered rays.

use super::path_packet::{NON_SPECULAR_BOUNCE, ONLY_SPECULAR, PathPacket, REACHED_BY_LIGHT_SAMPLING};
use super::path_tracer::PathTracer;
use super::surface_interactions::SurfaceInteractions;
use super::termination::{Termination, survival_probability};
use crate::render::bsdf::BsdfSamples;
use crate::render::sampler::BounceSamples;
use crate::simd::{LANES, Lanes, apply, lane_mask, multiversioned};

impl PathTracer<'_> {
    /// Scatters the paths in a mask's lanes into `next`. Returns the lanes of the paths that go on.
    pub(super) fn scatter(
        &self,
        mask: u32,
        packet: &PathPacket,
        interactions: &SurfaceInteractions,
        samples: &BounceSamples,
        next: &mut PathPacket,
    ) -> u32 {
        let mut scattered = BsdfSamples::NONE;
        interactions.sample_bsdfs(mask, &packet.rays, samples, &mut scattered);
        scattered_paths(mask, &self.termination, packet, interactions, &scattered, &samples.roulette, next)
    }
}

/// Computes the paths after a scattering event. Returns the lanes of `mask` whose paths go on.
#[apply(multiversioned!)]
fn scattered_paths(
    mask: u32,
    termination: &Termination,
    packet: &PathPacket,
    interactions: &SurfaceInteractions,
    scattered: &BsdfSamples,
    roulette: &Lanes,
    next: &mut PathPacket,
) -> u32 {
    let mut goes_on: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        // Update the throughput
        let throughput = packet.throughput.at(lane) * scattered.weight.at(lane);
        let is_black = (throughput.x == 0.0) & (throughput.y == 0.0) & (throughput.z == 0.0);
        let depth = packet.depth[lane] + 1;
        let eta = scattered.eta[lane];
        let eta_scale = packet.eta_scale[lane] * eta * eta;
        let is_specular = scattered.is_specular[lane] != 0;
        let only_specular = packet.flags[lane] & ONLY_SPECULAR;
        let wi = scattered.wi.at(lane);

        // Terminate paths, some by Russian roulette
        let is_needed = termination.needs_next_hit(depth, !is_specular);
        let has_roulette = termination.has_roulette(depth, throughput);
        let survival =
            if has_roulette { survival_probability((throughput * eta_scale).max_element()) } else { 1.0 };
        let survives = !has_roulette | (roulette[lane] < survival);
        goes_on[lane] = u32::from(!is_black & is_needed & survives);

        // Compute the scattered path
        next.path[lane] = packet.path[lane];
        next.flags[lane] =
            if is_specular { only_specular } else { NON_SPECULAR_BOUNCE | REACHED_BY_LIGHT_SAMPLING };
        next.depth[lane] = depth;
        next.interfaces[lane] = packet.interfaces[lane];
        next.rays.origin.set(lane, interactions.points.offset_origin(lane, wi));
        next.rays.direction.set(lane, wi);
        next.rays.time[lane] = packet.rays.time[lane];
        next.throughput.set(lane, throughput / survival);
        next.eta_scale[lane] = eta_scale;
        next.bsdf_pdf[lane] = scattered.pdf[lane];
    }
    next.prev_context = interactions.contexts;
    mask & lane_mask(|lane| goes_on[lane] != 0)
}
