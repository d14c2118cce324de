//! Queue of the paths whose next intersection is searched, in full packets where possible.

use super::path_packet::PathPacket;
use crate::simd::{ALL_LANES, LANES, lanes_in};

/// Paths to be continued, last in, first out, so that the queue stays short.
#[derive(Default)]
pub struct RayQueue {
    #[expect(clippy::vec_box, reason = "packets are taken out and given back without being copied")]
    packets: Vec<Box<PathPacket>>,
    len: usize,
    /// Allocated packets that are not in use.
    #[expect(clippy::vec_box, reason = "as above")]
    spare: Vec<Box<PathPacket>>,
}

impl RayQueue {
    /// Adds the path in a packet's lane.
    #[inline]
    pub fn push(&mut self, packet: &PathPacket, lane: usize) {
        self.reserve();
        self.packets[self.len / LANES].copy(self.len % LANES, packet, lane);
        self.len += 1;
    }

    /// Adds the paths in a mask's lanes of a packet.
    pub fn push_packet(&mut self, packet: &PathPacket, lanes: u32) {
        if lanes != ALL_LANES || !self.len.is_multiple_of(LANES) {
            lanes_in(lanes).for_each(|lane| self.push(packet, lane));
            return;
        }
        self.reserve();
        *self.packets[self.len / LANES] = *packet;
        self.len += LANES;
    }

    /// Removes and returns a packet, a full one if there is one, and its number of paths.
    #[inline]
    pub fn pop(&mut self) -> Option<(Box<PathPacket>, usize)> {
        let count = self.len.min(LANES);
        let last_full = (self.len / LANES).saturating_sub(1);
        let packet = (count > 0).then(|| self.packets.swap_remove(last_full));
        self.len -= count;
        packet.map(|packet| (packet, count))
    }

    /// Takes back the allocation of a packet from [`Self::pop`].
    pub fn recycle(&mut self, packet: Box<PathPacket>) {
        self.spare.push(packet);
    }

    fn reserve(&mut self) {
        if self.len == self.packets.len() * LANES {
            self.packets.push(self.spare.pop().unwrap_or_else(|| Box::new(PathPacket::NONE)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_path_is_popped_once_and_full_packets_first() {
        let mut queue = RayQueue::default();
        let mut packet = PathPacket::NONE;
        for path in 0..40 {
            packet.path[3] = path;
            queue.push(&packet, 3);
        }
        let mut seen = Vec::new();
        let mut counts = Vec::new();
        while let Some((packet, count)) = queue.pop() {
            seen.extend_from_slice(&packet.path[..count]);
            counts.push(count);
        }
        seen.sort_unstable();
        assert_eq!((counts, seen), (vec![LANES, LANES, 8], (0..40).collect()));
    }
}
