//! Paths on their way between two surfaces, sixteen to a packet.

use crate::geometry::{HitLanes, LANES, Lanes, Lanes3, RayLanes, lanes_of};
use crate::render::lights::{Receiver, Receivers};

/// A bit for each lane of a packet.
const ALL_LANES: u32 = u32::MAX >> (u32::BITS - LANES as u32);

/// The path came from a scattering event that was not perfectly specular.
pub const SCATTERED: u32 = 1;
/// Light sampling could have found what the path finds next, unless something else stood in its way.
pub const LIGHT_SAMPLING: u32 = 2;
/// No scattering event so far was other than perfectly specular.
pub const SEEN_DIRECTLY: u32 = 4;

/// A packet of paths.
#[derive(Clone, Copy)]
pub struct Flights {
    /// Their number in the wavefront.
    pub path: Lanes<u32>,
    pub flags: Lanes<u32>,
    /// Scattering events so far.
    pub depth: Lanes<u32>,
    /// Boundaries without effect that were passed.
    pub passes: Lanes<u32>,
    /// Of infinite length.
    pub rays: RayLanes,
    pub throughput: Lanes3,
    /// Product of the squared changes of the index of refraction, which the throughput contains
    /// and Russian roulette must not see.
    pub eta_scale: Lanes,
    /// Where a path was scattered, at first the camera, and with which density per solid angle.
    pub from: Receivers,
    pub pdf: Lanes,
}

impl Flights {
    pub const NONE: Self = Self {
        path: [0; LANES],
        flags: [0; LANES],
        depth: [0; LANES],
        passes: [0; LANES],
        rays: RayLanes { t_max: [f32::INFINITY; LANES], ..RayLanes::NONE },
        throughput: Lanes3::ZERO,
        eta_scale: [1.0; LANES],
        from: Receivers::NONE,
        pdf: [0.0; LANES],
    };

    #[inline]
    fn copy(&mut self, to: usize, packet: &Self, lane: usize) {
        self.path[to] = packet.path[lane];
        self.flags[to] = packet.flags[lane];
        self.depth[to] = packet.depth[lane];
        self.passes[to] = packet.passes[lane];
        self.rays.origin.set(to, packet.rays.origin.at(lane));
        self.rays.direction.set(to, packet.rays.direction.at(lane));
        self.rays.time[to] = packet.rays.time[lane];
        self.throughput.set(to, packet.throughput.at(lane));
        self.eta_scale[to] = packet.eta_scale[lane];
        self.from.position.set(to, packet.from.position.at(lane));
        self.from.normal.set(to, packet.from.normal.at(lane));
        self.from.transmits[to] = packet.from.transmits[lane];
        self.pdf[to] = packet.pdf[lane];
    }

    /// Where the path came from, if light sampling from there could have found what it finds.
    #[inline]
    pub fn origin(&self, lane: usize) -> Option<Receiver> {
        let both = SCATTERED | LIGHT_SAMPLING;
        (self.flags[lane] & both == both).then(|| self.from.at(lane))
    }
}

/// Paths that are to be followed. Those that came last go on first, so that few wait.
#[derive(Default)]
pub struct Waiting {
    #[expect(clippy::vec_box, reason = "packets are taken out and given back without being copied")]
    packets: Vec<Box<Flights>>,
    len: usize,
    /// Packets that are not in use.
    #[expect(clippy::vec_box, reason = "as above")]
    spare: Vec<Box<Flights>>,
}

impl Waiting {
    /// Adds the path in a packet's lane.
    #[inline]
    pub fn push(&mut self, packet: &Flights, lane: usize) {
        self.reserve();
        self.packets[self.len / LANES].copy(self.len % LANES, packet, lane);
        self.len += 1;
    }

    /// Adds the paths in some of a packet's lanes.
    pub fn push_packet(&mut self, packet: &Flights, lanes: u32) {
        if lanes != ALL_LANES || !self.len.is_multiple_of(LANES) {
            lanes_of(lanes).for_each(|lane| self.push(packet, lane));
            return;
        }
        self.reserve();
        *self.packets[self.len / LANES] = *packet;
        self.len += LANES;
    }

    /// Takes a packet, a full one if there is one, and tells how many are in it.
    #[inline]
    pub fn pop(&mut self) -> Option<(Box<Flights>, usize)> {
        let count = self.len.min(LANES);
        let last_full = (self.len / LANES).saturating_sub(1);
        let packet = (count > 0).then(|| self.packets.swap_remove(last_full));
        self.len -= count;
        packet.map(|packet| (packet, count))
    }

    /// Takes back a packet that is not needed any more, to be used again.
    pub fn give_back(&mut self, packet: Box<Flights>) {
        self.spare.push(packet);
    }

    fn reserve(&mut self) {
        if self.len == self.packets.len() * LANES {
            self.packets.push(self.spare.pop().unwrap_or_else(|| Box::new(Flights::NONE)));
        }
    }
}

/// Paths at surfaces.
pub struct Arrivals {
    pub flights: Flights,
    pub hits: HitLanes,
    pub count: usize,
}

impl Arrivals {
    pub const NONE: Self = Self { flights: Flights::NONE, hits: HitLanes::NONE, count: 0 };

    #[inline]
    pub fn push(&mut self, flights: &Flights, hits: &HitLanes, lane: usize) {
        let to = self.count;
        self.flights.copy(to, flights, lane);
        self.hits.t[to] = hits.t[lane];
        self.hits.primitive[to] = hits.primitive[lane];
        self.hits.element[to] = hits.element[lane];
        self.hits.instance[to] = hits.instance[lane];
        self.hits.barycentric[0][to] = hits.barycentric[0][lane];
        self.hits.barycentric[1][to] = hits.barycentric[1][lane];
        self.count += 1;
    }
}

/// Light that reaches paths if nothing is in its way.
pub struct Shadows {
    pub path: Lanes<u32>,
    pub light: Lanes3,
    pub rays: RayLanes,
    pub count: usize,
}

impl Shadows {
    pub const NONE: Self = Self { path: [0; LANES], light: Lanes3::ZERO, rays: RayLanes::NONE, count: 0 };

    #[inline]
    pub fn push(&mut self, path: u32, shadows: &Self, lane: usize) {
        let to = self.count;
        self.path[to] = path;
        self.light.set(to, shadows.light.at(lane));
        self.rays.set(to, shadows.rays.at(lane));
        self.count += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_path_that_waits_is_taken_once_and_full_packets_first() {
        let mut waiting = Waiting::default();
        let mut packet = Flights::NONE;
        for path in 0..40 {
            packet.path[3] = path;
            waiting.push(&packet, 3);
        }
        let mut seen = Vec::new();
        let mut counts = Vec::new();
        while let Some((packet, count)) = waiting.pop() {
            seen.extend_from_slice(&packet.path[..count]);
            counts.push(count);
        }
        seen.sort_unstable();
        assert_eq!((counts, seen), (vec![LANES, LANES, 8], (0..40).collect()));
    }
}
