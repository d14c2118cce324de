//! A packet of paths between two surfaces, one path a lane.

use crate::geometry::RayLanes;
use crate::render::lights::{LightSampleContext, LightSampleContexts};
use crate::simd::{LANES, Lanes, Lanes3};

/// Flag of a path whose last scattering event was not perfectly specular.
pub const NON_SPECULAR_BOUNCE: u32 = 1;
/// Flag of a path whose next hit light sampling could have sampled, unless another surface occludes it.
pub const REACHED_BY_LIGHT_SAMPLING: u32 = 2;
/// Flag of a path whose scattering events were all perfectly specular.
pub const ONLY_SPECULAR: u32 = 4;

/// Up to [`LANES`] paths.
#[derive(Clone, Copy)]
pub struct PathPacket {
    /// Index in the wavefront.
    pub path: Lanes<u32>,
    pub flags: Lanes<u32>,
    /// Scattering events so far.
    pub depth: Lanes<u32>,
    /// Interfaces passed so far, which do not count as scattering events.
    pub interfaces: Lanes<u32>,
    /// Rays of infinite length.
    pub rays: RayLanes,
    pub throughput: Lanes3,
    /// Product of the squared changes of the index of refraction, which the throughput contains
    /// and Russian roulette must not see.
    pub eta_scale: Lanes,
    /// The last scattering event, at first the camera, as light sampling sees it.
    pub prev_context: LightSampleContexts,
    /// Density per solid angle with which the BSDF sampled the ray's direction.
    pub bsdf_pdf: Lanes,
}

impl PathPacket {
    pub const NONE: Self = Self {
        path: [0; LANES],
        flags: [0; LANES],
        depth: [0; LANES],
        interfaces: [0; LANES],
        rays: RayLanes { t_max: [f32::INFINITY; LANES], ..RayLanes::NONE },
        throughput: Lanes3::ZERO,
        eta_scale: [1.0; LANES],
        prev_context: LightSampleContexts::NONE,
        bsdf_pdf: [0.0; LANES],
    };

    /// Copies lane `lane` of `packet` to lane `to`.
    #[inline]
    pub fn copy(&mut self, to: usize, packet: &Self, lane: usize) {
        self.path[to] = packet.path[lane];
        self.flags[to] = packet.flags[lane];
        self.depth[to] = packet.depth[lane];
        self.interfaces[to] = packet.interfaces[lane];
        self.rays.origin.set(to, packet.rays.origin.at(lane));
        self.rays.direction.set(to, packet.rays.direction.at(lane));
        self.rays.time[to] = packet.rays.time[lane];
        self.throughput.set(to, packet.throughput.at(lane));
        self.eta_scale[to] = packet.eta_scale[lane];
        self.prev_context.position.set(to, packet.prev_context.position.at(lane));
        self.prev_context.normal.set(to, packet.prev_context.normal.at(lane));
        self.prev_context.transmits[to] = packet.prev_context.transmits[lane];
        self.bsdf_pdf[to] = packet.bsdf_pdf[lane];
    }

    /// Returns the last scattering event if light sampling there could have sampled the path's next hit.
    #[inline]
    pub fn mis_context(&self, lane: usize) -> Option<LightSampleContext> {
        let both = NON_SPECULAR_BOUNCE | REACHED_BY_LIGHT_SAMPLING;
        (self.flags[lane] & both == both).then(|| self.prev_context.at(lane))
    }

    /// Returns whether the path was not scattered yet, or by perfectly specular events only.
    #[inline]
    pub fn is_only_specular(&self, lane: usize) -> bool {
        self.flags[lane] & ONLY_SPECULAR != 0
    }
}
