//! Sixteen of everything: the form in which rays, hits and points go through loops that the compiler
//! turns into vector code.

use glam::{Vec2, Vec3};

use super::{Hit, Ray, SurfacePoint};

/// How many go together.
pub const LANES: usize = 16;

pub type Lanes<T = f32> = [T; LANES];

/// Vectors in lanes.
#[derive(Clone, Copy, Debug)]
pub struct Lanes3 {
    pub x: Lanes,
    pub y: Lanes,
    pub z: Lanes,
}

impl Lanes3 {
    pub const ZERO: Self = Self { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES] };

    #[inline(always)]
    pub fn at(&self, lane: usize) -> Vec3 {
        Vec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: Vec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = (v.x, v.y, v.z);
    }

    /// Sets a lane that is on, without a branch.
    #[inline(always)]
    pub fn put(&mut self, lane: usize, is_on: bool, v: Vec3) {
        self.x[lane] = if is_on { v.x } else { self.x[lane] };
        self.y[lane] = if is_on { v.y } else { self.y[lane] };
        self.z[lane] = if is_on { v.z } else { self.z[lane] };
    }
}

/// Rays in lanes.
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

/// The nearest intersections of rays in lanes.
#[derive(Clone, Copy, Debug)]
pub struct HitLanes {
    pub t: Lanes,
    /// [`HitLanes::NOTHING`] where there is none.
    pub primitive: Lanes<u32>,
    pub element: Lanes<u32>,
    pub instance: Lanes<u32>,
    pub barycentric: [Lanes; 2],
}

impl HitLanes {
    /// `primitive` of no hit.
    pub const NOTHING: u32 = u32::MAX;

    pub const NONE: Self = Self {
        t: [0.0; LANES],
        primitive: [Self::NOTHING; LANES],
        element: [0; LANES],
        instance: [Hit::STATIC; LANES],
        barycentric: [[0.0; LANES]; 2],
    };

    #[inline(always)]
    pub fn at(&self, lane: usize) -> Option<Hit> {
        (self.primitive[lane] != Self::NOTHING).then(|| Hit {
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
            self.primitive[lane] = Self::NOTHING;
            return;
        };
        self.t[lane] = hit.t;
        self.primitive[lane] = hit.primitive;
        self.element[lane] = hit.element;
        self.instance[lane] = hit.instance;
        (self.barycentric[0][lane], self.barycentric[1][lane]) = (hit.barycentric.x, hit.barycentric.y);
    }
}

/// What is needed of points on surfaces wherever their parametrisation is not: see [`SurfacePoint`].
#[derive(Clone, Copy, Debug)]
pub struct PointLanes {
    pub position: Lanes3,
    pub position_error: Lanes3,
    pub geometric_normal: Lanes3,
    pub shading_normal: Lanes3,
    pub element: Lanes<u32>,
}

impl PointLanes {
    pub const NONE: Self = Self {
        position: Lanes3::ZERO,
        position_error: Lanes3::ZERO,
        geometric_normal: Lanes3::ZERO,
        shading_normal: Lanes3::ZERO,
        element: [0; LANES],
    };

    #[inline(always)]
    pub fn set(&mut self, lane: usize, point: &SurfacePoint) {
        self.position.set(lane, point.position);
        self.position_error.set(lane, point.position_error);
        self.geometric_normal.set(lane, point.geometric_normal);
        self.shading_normal.set(lane, point.shading_normal);
        self.element[lane] = point.element;
    }

    /// The point, which is on this primitive. Its tangents are any that are perpendicular to the normal.
    pub fn at(&self, lane: usize, primitive: u32) -> SurfacePoint {
        let geometric_normal = self.geometric_normal.at(lane);
        let (dpdu, dpdv) = geometric_normal.any_orthonormal_pair();
        SurfacePoint {
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

    /// As [`SurfacePoint::offset_origin`].
    #[inline(always)]
    pub fn offset_origin(&self, lane: usize, w: Vec3) -> Vec3 {
        let (position, error) = (self.position.at(lane), self.position_error.at(lane));
        super::rounding::offset_origin(position, error, self.geometric_normal.at(lane), w)
    }
}

/// The lanes of a mask, one by one.
#[inline]
pub fn lanes_of(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    })
}

/// The mask of the lanes for which something holds.
#[inline(always)]
pub fn mask_of(holds: impl Fn(usize) -> bool) -> u32 {
    (0..LANES).fold(0, |mask, lane| mask | u32::from(holds(lane)) << lane)
}

/// The lanes of a mask by their values: passes on each value with the mask of the lanes that have it.
#[inline]
pub fn groups(values: &Lanes<u32>, mut mask: u32, mut each: impl FnMut(u32, u32)) {
    while mask != 0 {
        let value = values[mask.trailing_zeros() as usize % LANES];
        let same = mask & mask_of(|lane| values[lane] == value);
        mask &= !same;
        each(value, same);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_part_a_mask_by_value() {
        let values: Lanes<u32> = std::array::from_fn(|lane| lane as u32 % 3);
        let mut seen = Vec::new();
        groups(&values, 0b1111_0000_0001_0110, |value, lanes| seen.push((value, lanes)));
        assert_eq!(
            seen,
            [(1, 0b0010_0000_0001_0010), (2, 0b0100_0000_0000_0100), (0, 0b1001_0000_0000_0000)]
        );
        assert_eq!(lanes_of(0b1001_0000_0000_0101).collect::<Vec<_>>(), [0, 2, 12, 15]);
    }
}
