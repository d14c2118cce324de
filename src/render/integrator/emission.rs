//! Emission that paths reach by BSDF sampling: of surfaces that they hit, and of environments where they leave
//! the scene.

use glam::Vec3;

use super::mis::emission_weight;
use super::path_packet::PathPacket;
use super::path_tracer::PathTracer;
use super::wavefront::record_slot;
use crate::geometry::SurfaceInteraction;
use crate::render::sample_records::SampleRecords;

impl PathTracer<'_> {
    /// Adds the emission of a surface that a path hits.
    pub(super) fn add_surface_emission(
        &self,
        packet: &PathPacket,
        lane: usize,
        point: &SurfaceInteraction,
        records: &mut [SampleRecords],
    ) {
        if let Some(emitted) = self.lights.emitted_radiance(point, -packet.rays.direction.at(lane)) {
            let weight = emission_weight(packet, lane, |context| self.lights.pdf_area_light(context, point));
            add_emission(packet, lane, emitted * weight, records);
        }
    }

    /// Adds the emission of environments to a path that leaves the scene. `finite` is
    /// [`crate::render::lights::Lights::finite_irradiance`] of its last scattering event.
    #[inline]
    pub(super) fn add_environment_emission(
        &self,
        packet: &PathPacket,
        lane: usize,
        finite: f32,
        records: &mut [SampleRecords],
    ) {
        let direction = packet.rays.direction.at(lane);
        // Interfaces passed since the last scattering event do not move the position seen by a portal.
        for (i, radiance) in self.lights.environments(packet.prev_context.position.at(lane), direction) {
            let light_pdf = |context: &_| self.lights.pdf_environment(context, finite, i, direction);
            add_emission(packet, lane, radiance * emission_weight(packet, lane, light_pdf), records);
        }
    }
}

#[inline]
fn add_emission(packet: &PathPacket, lane: usize, radiance: Vec3, records: &mut [SampleRecords]) {
    let (record, slot) = record_slot(packet.path[lane]);
    let record = &mut records[record];
    let is_visible = packet.is_only_specular(lane);
    let sum = if is_visible { &mut record.visible_emission } else { &mut record.bsdf_sampled };
    sum.set(slot, sum.at(slot) + packet.throughput.at(lane) * radiance);
}
