//! The wavefront loop: intersects the rays of all paths and shades the hits until every path has ended.

use super::hit_queue::HitQueue;
use super::path_packet::PathPacket;
use super::path_tracer::PathTracer;
use super::wavefront::Wavefront;
use crate::geometry::HitLanes;
use crate::render::sampler::Sampler;
use crate::simd::{LANES, lane_mask, lanes_in};

impl<'s> PathTracer<'s> {
    /// Traces all paths of the wavefront to their ends and fills in their records.
    pub fn trace<S: Sampler>(&self, wave: &mut Wavefront<'s>) {
        loop {
            if let Some((packet, count)) = wave.ray_queue.pop() {
                self.intersect::<S>(wave, &packet, count);
                wave.ray_queue.recycle(packet);
            } else if wave.hit_queue.count > 0 {
                self.shade_hit_queue::<S>(wave);
            } else {
                break;
            }
        }
        self.add_unoccluded_light(&mut wave.shadow_rays, &mut wave.records);
    }

    /// Intersects the first `count` rays of a packet with the scene. A full packet of hits is shaded at once;
    /// other hits go to the hit queue.
    fn intersect<S: Sampler>(&self, wave: &mut Wavefront<'s>, packet: &PathPacket, count: usize) {
        let mut hits = HitLanes::NONE;
        self.accel.intersect_lanes(&packet.rays, count, &mut hits);
        let is_miss = |lane| hits.primitive[lane] == HitLanes::NO_HIT;
        let misses = lane_mask(|lane| lane < count && is_miss(lane));
        if misses == 0 && count == LANES {
            return self.shade::<S>(wave, packet, &hits, count);
        }
        if misses != 0 {
            let finite = self.lights.finite_irradiance(&packet.prev_context);
            for lane in lanes_in(misses) {
                self.add_environment_emission(packet, lane, finite[lane], &mut wave.records);
                self.record_environment(packet, lane, &mut wave.records);
            }
        }
        for lane in (0..count).filter(|&lane| !is_miss(lane)) {
            wave.hit_queue.push(packet, &hits, lane);
            if wave.hit_queue.count == LANES {
                self.shade_hit_queue::<S>(wave);
            }
        }
    }

    /// Shades and empties the hit queue.
    fn shade_hit_queue<S: Sampler>(&self, wave: &mut Wavefront<'s>) {
        let empty = wave.spare_hit_queue.take().unwrap_or_else(|| Box::new(HitQueue::EMPTY));
        let mut queue = std::mem::replace(&mut wave.hit_queue, empty);
        let count = std::mem::take(&mut queue.count);
        self.shade::<S>(wave, &queue.packet, &queue.hits, count);
        wave.spare_hit_queue = Some(queue);
    }
}
