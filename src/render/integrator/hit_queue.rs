//! Queue of the paths that hit a surface and are not shaded yet: at most one packet.

use super::path_packet::PathPacket;
use crate::geometry::HitLanes;

/// The first `count` lanes hold paths and their hits.
pub struct HitQueue {
    pub packet: PathPacket,
    pub hits: HitLanes,
    pub count: usize,
}

impl HitQueue {
    pub const EMPTY: Self = Self { packet: PathPacket::NONE, hits: HitLanes::NONE, count: 0 };

    /// Adds the path in a packet's lane and its hit; the queue must not be full.
    #[inline]
    pub fn push(&mut self, packet: &PathPacket, hits: &HitLanes, lane: usize) {
        let to = self.count;
        self.packet.copy(to, packet, lane);
        self.hits.t[to] = hits.t[lane];
        self.hits.primitive[to] = hits.primitive[lane];
        self.hits.element[to] = hits.element[lane];
        self.hits.instance[to] = hits.instance[lane];
        self.hits.barycentric[0][to] = hits.barycentric[0][lane];
        self.hits.barycentric[1][to] = hits.barycentric[1][lane];
        self.count += 1;
    }
}
