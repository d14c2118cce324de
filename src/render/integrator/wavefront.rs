//! Wavefront of paths: the state of all paths that are traced together, and the queues between the stages
//! (Laine, Karras and Aila 2013, "Megakernels Considered Harmful: Wavefront Path Tracing on GPUs").

use super::hit_queue::HitQueue;
use super::path_packet::{ONLY_SPECULAR, PathPacket};
use super::ray_queue::RayQueue;
use super::scalar_interaction::ScalarInteraction;
use super::shadow_ray_queue::ShadowRayQueue;
use crate::geometry::RayLanes;
use crate::render::lights::LightSampleContexts;
use crate::render::sample_records::SampleRecords;
use crate::render::sampler::SampleAddresses;
use crate::simd::{LANES, Lanes3};

/// Paths that are traced together.
pub struct Wavefront<'s> {
    /// By the packets in which paths were started: the addresses of their sample values, and what is
    /// recorded of them.
    pub(super) addresses: Vec<SampleAddresses>,
    pub(super) records: Vec<SampleRecords>,
    pub(super) ray_queue: RayQueue,
    pub(super) hit_queue: Box<HitQueue>,
    /// Receives hits while those of `hit_queue` are shaded.
    pub(super) spare_hit_queue: Option<Box<HitQueue>>,
    pub(super) shadow_rays: ShadowRayQueue,
    /// Allocations used while a packet is shaded.
    pub(super) scalar_interactions: Vec<ScalarInteraction<'s>>,
    pub(super) scattered: Box<PathPacket>,
}

impl Default for Wavefront<'_> {
    fn default() -> Self {
        Self {
            addresses: Vec::new(),
            records: Vec::new(),
            ray_queue: RayQueue::default(),
            hit_queue: Box::new(HitQueue::EMPTY),
            spare_hit_queue: None,
            shadow_rays: ShadowRayQueue::EMPTY,
            scalar_interactions: Vec::new(),
            scattered: Box::new(PathPacket::NONE),
        }
    }
}

impl Wavefront<'_> {
    pub fn clear(&mut self) {
        self.addresses.clear();
        self.records.clear();
    }

    /// Adds the camera rays in the lanes of `mask` and returns their records, which are empty.
    pub fn start(&mut self, rays: &RayLanes, addresses: &SampleAddresses, mask: u32) -> &mut SampleRecords {
        let first = (self.records.len() * LANES) as u32;
        let mut packet = PathPacket {
            rays: *rays,
            throughput: Lanes3 { x: [1.0; LANES], y: [1.0; LANES], z: [1.0; LANES] },
            flags: [ONLY_SPECULAR; LANES],
            prev_context: LightSampleContexts { position: rays.origin, ..LightSampleContexts::NONE },
            ..PathPacket::NONE
        };
        (first..).zip(&mut packet.path).for_each(|(path, lane)| *lane = path);
        self.ray_queue.push_packet(&packet, mask);
        self.addresses.push(*addresses);
        let packet = self.records.len();
        self.records.push(SampleRecords::NONE);
        &mut self.records[packet]
    }

    /// Returns what is recorded of the paths, by the packets in which they were started.
    pub fn records(&self) -> &[SampleRecords] {
        &self.records
    }
}

/// Returns the packet in which a path was started, and its lane there.
#[inline(always)]
pub(super) fn record_slot(path: u32) -> (usize, usize) {
    (path as usize / LANES, path as usize % LANES)
}
