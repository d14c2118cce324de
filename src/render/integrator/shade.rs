//! Shading of a packet's hits: adds emission and sampled light, records features, and scatters the paths.

use glam::Vec2;

use super::path_packet::{NON_SPECULAR_BOUNCE, PathPacket, REACHED_BY_LIGHT_SAMPLING};
use super::path_tracer::{MAX_INTERFACES, PathTracer};
use super::ray_queue::RayQueue;
use super::scalar_interaction::ScalarInteraction;
use super::surface_interactions::SurfaceInteractions;
use super::wavefront::{Wavefront, record_slot};
use crate::geometry::{HitLanes, InteractionLanes, SurfaceInteraction};
use crate::render::bsdf::{Bsdf, SimdBsdfs};
use crate::render::lights::LightSampleContexts;
use crate::render::sampler::{BounceSamples, SampleAddresses, Sampler};
use crate::scene::MaterialId;
use crate::scene::texture::TexturePoint;
use crate::simd::{lane_mask, lanes_in};

impl<'s> PathTracer<'s> {
    /// Shades the first `count` paths of a packet, which have hit surfaces. Paths that go on enter the ray
    /// queue.
    pub(super) fn shade<S: Sampler>(
        &self,
        wave: &mut Wavefront<'s>,
        packet: &PathPacket,
        hits: &HitLanes,
        count: usize,
    ) {
        // Compute the surface interactions
        let all = (1 << count) - 1;
        let scalar = std::mem::take(&mut wave.scalar_interactions);
        let mut interactions = self.surface_interactions(packet, hits, all, scalar);

        // Add the emission of the surfaces
        for lane in 0..count {
            if self.lights.is_emissive(hits.primitive[lane]) {
                let point = interactions.at(lane, hits.primitive[lane]);
                self.add_surface_emission(packet, lane, &point, &mut wave.records);
            }
        }

        // Find the lanes whose materials are needed
        // Nothing scatters at the last hit, but light may pass the surface there.
        let last = all & lane_mask(|lane| self.ends_at_hit(packet, lane));
        let first = lane_mask(|lane| packet.depth[lane] == 0);
        let evaluated = if self.may_pass_surfaces { all } else { all & !(last & !first) };
        for lane in lanes_in(all & !evaluated) {
            self.record_second_hit(packet, lane, &interactions, &mut wave.records);
        }

        // Evaluate the materials and scatter the paths
        if evaluated != 0 {
            self.shade_materials::<S>(wave, packet, hits, evaluated, last, &mut interactions);
        }
        wave.scalar_interactions = interactions.scalar;
    }

    /// Computes the surface interactions in a mask's lanes. `scalar` is an allocation to reuse.
    fn surface_interactions(
        &self,
        packet: &PathPacket,
        hits: &HitLanes,
        mask: u32,
        mut scalar: Vec<ScalarInteraction<'s>>,
    ) -> SurfaceInteractions<'_, 's> {
        let mut points = InteractionLanes::NONE;
        let mut simd = 0;
        for lane in lanes_in(mask) {
            simd |= u32::from(self.has_simd_material[hits.primitive[lane] as usize]) << lane;
        }
        self.accel.minimal_interactions(&packet.rays, hits, simd, &mut points);
        scalar.clear();
        for lane in lanes_in(mask & !simd) {
            let (ray, hit) = (packet.rays.at(lane), hits.at(lane).expect("the path has hit a surface"));
            let point = if self.material_traits[self.material(hit.primitive) as usize].needs_parametrisation {
                self.accel.interaction(&ray, &hit)
            } else {
                self.accel.minimal_interaction(&ray, &hit)
            };
            points.set(lane, &point);
            scalar.push(ScalarInteraction { lane, point, bsdf: None });
        }
        SurfaceInteractions {
            points,
            normals: points.shading_normal,
            simd,
            simd_bsdfs: SimdBsdfs::new(&self.simd_materials),
            scalar,
            contexts: LightSampleContexts::NONE,
        }
    }

    /// Evaluates the materials in the lanes of `mask`, records features, samples lights, and scatters the
    /// paths that do not end at their `last` hit.
    #[inline]
    fn shade_materials<S: Sampler>(
        &self,
        wave: &mut Wavefront<'s>,
        packet: &PathPacket,
        hits: &HitLanes,
        mask: u32,
        last: u32,
        interactions: &mut SurfaceInteractions<'_, 's>,
    ) {
        // Generate the sample values
        let Wavefront { addresses, records, ray_queue, shadow_rays, scattered, .. } = wave;
        let mut packet_addresses = SampleAddresses::NONE;
        for lane in lanes_in(mask) {
            let (record, slot) = record_slot(packet.path[lane]);
            packet_addresses.set(lane, addresses[record].at(slot));
        }
        let samples = self.dimensions.bounce::<S>(&packet_addresses, &packet.depth);

        // Evaluate the materials
        let simd = mask & interactions.simd;
        self.evaluate_simd_materials(simd, hits, interactions);
        let (scalar, specular) = self.evaluate_scalar_materials(
            mask,
            packet,
            hits,
            &packet_addresses,
            &samples,
            interactions,
            ray_queue,
        );

        // Record the first and second hits
        let present = simd | scalar;
        let first = lane_mask(|lane| packet.depth[lane] == 0);
        for lane in lanes_in(present & first) {
            self.record_first_hit(packet, lane, hits, interactions, records);
        }
        for lane in lanes_in(present & !first) {
            self.record_second_hit(packet, lane, interactions, records);
        }

        // Sample lights, and the BSDFs
        let scatters = present & !last;
        if scatters == 0 {
            return;
        }
        interactions.set_contexts(&packet.rays);
        self.sample_lights(scatters & !specular, packet, interactions, &samples, shadow_rays, records);
        if self.samples_bsdfs {
            let goes_on = self.scatter(scatters, packet, interactions, &samples, scattered);
            ray_queue.push_packet(scattered, goes_on);
        }
    }

    /// Evaluates the SIMD materials in a mask's lanes.
    #[inline]
    fn evaluate_simd_materials(&self, mask: u32, hits: &HitLanes, interactions: &mut SurfaceInteractions) {
        for lane in lanes_in(mask) {
            let material = self.material(hits.primitive[lane]);
            let position = interactions.points.position.at(lane);
            interactions.simd_bsdfs.set(lane, material, &self.scene.textures, || TexturePoint {
                uv: hits.at(lane).map_or(Vec2::ZERO, |hit| self.accel.triangle_uv(&hit)),
                position,
            });
        }
    }

    /// Evaluates all other materials in a mask's lanes. Paths at interfaces pass them and enter the ray queue.
    /// Returns the lanes with BSDFs, and those of them whose BSDFs are perfectly specular.
    #[expect(clippy::too_many_arguments, reason = "the packet's parts")]
    #[inline]
    fn evaluate_scalar_materials(
        &self,
        mask: u32,
        packet: &PathPacket,
        hits: &HitLanes,
        addresses: &SampleAddresses,
        samples: &BounceSamples,
        interactions: &mut SurfaceInteractions<'_, 's>,
        ray_queue: &mut RayQueue,
    ) -> (u32, u32) {
        let (mut present, mut specular) = (0, 0);
        for scalar in &mut interactions.scalar {
            let lane = scalar.lane;
            if mask >> lane & 1 == 0 {
                continue;
            }
            let mix = samples.mix_after(lane, packet.interfaces[lane], addresses.at(lane));
            let material = MaterialId(self.material(hits.primitive[lane]));
            let wo = -packet.rays.direction.at(lane);
            scalar.bsdf = Bsdf::new(self.scene, material, &scalar.point, wo, mix);
            let Some(bsdf) = &scalar.bsdf else {
                self.pass_interface(packet, lane, &scalar.point, ray_queue);
                continue;
            };
            interactions.normals.set(lane, bsdf.shading_normal());
            interactions.contexts.transmits[lane] = u32::from(bsdf.transmits());
            present |= 1 << lane;
            specular |= u32::from(bsdf.is_specular()) << lane;
        }
        (present, specular)
    }

    /// Returns whether the path ends at its hit.
    #[inline(always)]
    fn ends_at_hit(&self, packet: &PathPacket, lane: usize) -> bool {
        self.termination.ends_at_hit(packet.depth[lane], packet.flags[lane] & NON_SPECULAR_BOUNCE != 0)
    }

    /// Continues a path in the same direction behind an interface.
    fn pass_interface(
        &self,
        packet: &PathPacket,
        lane: usize,
        point: &SurfaceInteraction,
        ray_queue: &mut RayQueue,
    ) {
        let mut next = *packet;
        next.interfaces[lane] += 1;
        if next.interfaces[lane] > MAX_INTERFACES {
            return;
        }
        let origin = point.offset_origin(packet.rays.direction.at(lane));
        next.rays.origin.set(lane, origin);
        // Shadow rays pass interfaces, but not mixes with one.
        if !self.is_interface(point) {
            next.flags[lane] &= !REACHED_BY_LIGHT_SAMPLING;
        }
        ray_queue.push(&next, lane);
    }
}
