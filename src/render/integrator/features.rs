//! Features of a path's first and second hit, recorded for the denoiser.

use glam::Vec3;

use super::path_packet::PathPacket;
use super::path_tracer::PathTracer;
use super::surface_interactions::SurfaceInteractions;
use super::wavefront::record_slot;
use crate::geometry::{HitLanes, face_forward};
use crate::render::sample_records::SampleRecords;

/// Distance, in scene diameters, of the position recorded for a path that leaves the scene.
const ENVIRONMENT_DISTANCE: f32 = 2.0;

impl PathTracer<'_> {
    /// Records the first hit: position, normal and albedo. The position stands for the second hit as well,
    /// until there is one.
    pub(super) fn record_first_hit(
        &self,
        packet: &PathPacket,
        lane: usize,
        hits: &HitLanes,
        interactions: &SurfaceInteractions,
        records: &mut [SampleRecords],
    ) {
        let (record, slot) = record_slot(packet.path[lane]);
        let record = &mut records[record];
        let wo = -packet.rays.direction.at(lane);
        let (position, normal) = (interactions.points.position.at(lane), interactions.normals.at(lane));
        record.hit[slot] = 1.0;
        record.position1.set(slot, position * self.inverse_diameter);
        record.position2.set(slot, position * self.inverse_diameter);
        record.normal1.set(slot, face_forward(normal, wo));
        if self.records_albedo {
            let albedo = match interactions.scalar_bsdf(lane) {
                None => interactions.simd_bsdfs.albedo(lane, normal, wo),
                Some(bsdf) if bsdf.is_specular() => Vec3::ONE,
                Some(bsdf) => bsdf.albedo(),
            };
            let emits = || {
                let point = interactions.at(lane, hits.primitive[lane]);
                self.lights.is_emissive(point.primitive) && self.lights.emitted_radiance(&point, wo).is_some()
            };
            let only_emits = albedo == Vec3::ZERO && emits();
            record.albedo.set(slot, if only_emits { Vec3::ONE } else { albedo });
        }
    }

    /// Records position and normal of the hit if it is the path's second. The normal is the interpolated one:
    /// bump and normal maps are not evaluated where a path ends.
    #[inline]
    pub(super) fn record_second_hit(
        &self,
        packet: &PathPacket,
        lane: usize,
        interactions: &SurfaceInteractions,
        records: &mut [SampleRecords],
    ) {
        if packet.depth[lane] == 1 {
            let (record, slot) = record_slot(packet.path[lane]);
            let record = &mut records[record];
            let points = &interactions.points;
            record.position2.set(slot, points.position.at(lane) * self.inverse_diameter);
            let normal = face_forward(points.shading_normal.at(lane), -packet.rays.direction.at(lane));
            record.normal2.set(slot, normal);
        }
    }

    /// Records a distant position for a path that leaves the scene instead of its first or second hit.
    #[inline]
    pub(super) fn record_environment(&self, packet: &PathPacket, lane: usize, records: &mut [SampleRecords]) {
        let (record, slot) = record_slot(packet.path[lane]);
        let record = &mut records[record];
        let distant = ENVIRONMENT_DISTANCE * packet.rays.direction.at(lane);
        match packet.depth[lane] {
            0 => {
                let position = packet.rays.origin.at(lane) * self.inverse_diameter + distant;
                record.position1.set(slot, position);
                record.position2.set(slot, position);
                record.albedo.set(slot, Vec3::ONE);
            }
            1 => record.position2.set(slot, record.position1.at(slot) + distant),
            _ => {}
        }
    }
}
