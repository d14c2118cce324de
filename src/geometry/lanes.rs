//! Rays, hits and surface interactions in structures of arrays, one in each lane.

use glam::{Vec2, Vec3};

use super::{Hit, Ray, SurfaceInteraction, rounding};
use crate::simd::{LANES, Lanes, Lanes3};

/// One [`Ray`] in each lane.
#[derive(Clone, Copy, Debug)]
pub struct RayLanes {
    pub origin: Lanes3,
    pub direction: Lanes3,
    pub t_max: Lanes,
    pub time: Lanes,
}

impl RayLanes {
    pub const NONE: Self =
        Self { origin: Lanes3::ZERO, direction: Lanes3::ZERO, t_max: [0.0; LANES], time: [0.0; LANES] };

    #[inline(always)]
    pub fn at(&self, lane: usize) -> Ray {
        Ray {
            origin: self.origin.at(lane),
            direction: self.direction.at(lane),
            t_max: self.t_max[lane],
            time: self.time[lane],
        }
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, ray: Ray) {
        self.origin.set(lane, ray.origin);
        self.direction.set(lane, ray.direction);
        self.t_max[lane] = ray.t_max;
        self.time[lane] = ray.time;
    }
}

/// The nearest intersection of each lane's ray.
#[derive(Clone, Copy, Debug)]
pub struct HitLanes {
    pub t: Lanes,
    /// [`HitLanes::NO_HIT`] where the ray hits nothing.
    pub primitive: Lanes<u32>,
    pub element: Lanes<u32>,
    pub instance: Lanes<u32>,
    pub barycentric: [Lanes; 2],
}

impl HitLanes {
    /// `primitive` of a ray that hits nothing.
    pub const NO_HIT: u32 = u32::MAX;

    pub const NONE: Self = Self {
        t: [0.0; LANES],
        primitive: [Self::NO_HIT; LANES],
        element: [0; LANES],
        instance: [Hit::STATIC; LANES],
        barycentric: [[0.0; LANES]; 2],
    };

    #[inline(always)]
    pub fn at(&self, lane: usize) -> Option<Hit> {
        (self.primitive[lane] != Self::NO_HIT).then(|| Hit {
            t: self.t[lane],
            primitive: self.primitive[lane],
            element: self.element[lane],
            instance: self.instance[lane],
            barycentric: Vec2::new(self.barycentric[0][lane], self.barycentric[1][lane]),
        })
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, hit: Option<Hit>) {
        let Some(hit) = hit else {
            self.primitive[lane] = Self::NO_HIT;
            return;
        };
        self.t[lane] = hit.t;
        self.primitive[lane] = hit.primitive;
        self.element[lane] = hit.element;
        self.instance[lane] = hit.instance;
        (self.barycentric[0][lane], self.barycentric[1][lane]) = (hit.barycentric.x, hit.barycentric.y);
    }
}

/// One [`SurfaceInteraction`] in each lane, without parametrisation.
#[derive(Clone, Copy, Debug)]
pub struct InteractionLanes {
    pub position: Lanes3,
    pub position_error: Lanes3,
    pub geometric_normal: Lanes3,
    pub shading_normal: Lanes3,
    pub element: Lanes<u32>,
}

impl InteractionLanes {
    pub const NONE: Self = Self {
        position: Lanes3::ZERO,
        position_error: Lanes3::ZERO,
        geometric_normal: Lanes3::ZERO,
        shading_normal: Lanes3::ZERO,
        element: [0; LANES],
    };

    #[inline(always)]
    pub fn set(&mut self, lane: usize, interaction: &SurfaceInteraction) {
        self.position.set(lane, interaction.position);
        self.position_error.set(lane, interaction.position_error);
        self.geometric_normal.set(lane, interaction.geometric_normal);
        self.shading_normal.set(lane, interaction.shading_normal);
        self.element[lane] = interaction.element;
    }

    /// Returns the interaction of a lane, which is on `primitive`. Texture coordinates are 0, tangents an
    /// arbitrary orthonormal pair perpendicular to the geometric normal.
    pub fn at(&self, lane: usize, primitive: u32) -> SurfaceInteraction {
        let geometric_normal = self.geometric_normal.at(lane);
        let (dpdu, dpdv) = geometric_normal.any_orthonormal_pair();
        SurfaceInteraction {
            position: self.position.at(lane),
            position_error: self.position_error.at(lane),
            geometric_normal,
            shading_normal: self.shading_normal.at(lane),
            dpdu,
            dpdv,
            uv: Vec2::ZERO,
            primitive,
            element: self.element[lane],
        }
    }

    /// As [`SurfaceInteraction::offset_origin`].
    #[inline(always)]
    pub fn offset_origin(&self, lane: usize, w: Vec3) -> Vec3 {
        let (position, error) = (self.position.at(lane), self.position_error.at(lane));
        rounding::offset_origin(position, error, self.geometric_normal.at(lane), w)
    }
}
