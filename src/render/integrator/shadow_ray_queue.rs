//! Queue of shadow rays, with the radiance that each path gains if its ray is unoccluded: at most one packet.

use crate::geometry::RayLanes;
use crate::simd::{LANES, Lanes, Lanes3};

/// The first `count` lanes hold shadow rays.
pub struct ShadowRayQueue {
    /// Index of the path in the wavefront.
    pub path: Lanes<u32>,
    pub radiance: Lanes3,
    pub rays: RayLanes,
    pub count: usize,
}

impl ShadowRayQueue {
    pub const EMPTY: Self = Self { path: [0; LANES], radiance: Lanes3::ZERO, rays: RayLanes::NONE, count: 0 };

    /// Adds the shadow ray in lane `lane` of `shadow_rays` for `path`; the queue must not be full.
    #[inline]
    pub fn push(&mut self, path: u32, shadow_rays: &Self, lane: usize) {
        let to = self.count;
        self.path[to] = path;
        self.radiance.set(to, shadow_rays.radiance.at(lane));
        self.rays.set(to, shadow_rays.rays.at(lane));
        self.count += 1;
    }
}
