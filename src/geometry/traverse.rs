//! Walks a ray through an eight-wide hierarchy, nearest boxes first.
//!
//! Everything here is inlined into functions compiled for several instruction sets; loops over
//! [`WIDTH`] lanes become vector instructions. No operation is fused, so that all of them give the
//! same bits.

use glam::{DAffine3, Vec3};

use super::bvh::{Bvh, LEAF, Node, WIDTH};
use super::rounding::gamma;

/// Widening of a ray's interval in each box. It covers the rounding of the slab test (Ize 2013:
/// two of γ(3)) and that of the triangle test's shear, so that a ray enters every box with a
/// triangle that it hits; an unneeded visit costs nothing in correctness.
const SLAB_WIDENING: f32 = 1.0 + 2.0 * gamma(16);

/// Entries of the stack before it spills to the heap; enough for any but degenerate scenes.
const STACK_SIZE: usize = 96;

/// A ray, prepared for boxes and triangles.
#[derive(Clone, Copy, Debug)]
pub struct TraversalRay {
    pub origin: Vec3,
    pub direction: Vec3,
    inverse: Vec3,
    /// Distance of the nearest hit so far.
    pub t_max: f32,
    /// For each axis 0 if the ray meets a box's minimum first, otherwise 1.
    backward: [usize; 3],
    /// Axes permuted so that the last is the one of the largest direction component, and the
    /// handedness is kept (Woop, Benthin and Wald 2013, section 3.1).
    pub axes: [usize; 3],
    /// Shear that takes the direction to the last axis, and that axis' scale.
    pub shear: [f32; 3],
}

impl TraversalRay {
    /// `None` for rays that can hit nothing: not finite, or without a direction.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Option<Self> {
        let major = {
            let size = direction.abs();
            if size.x > size.y && size.x > size.z {
                0
            } else if size.y > size.z {
                1
            } else {
                2
            }
        };
        let usable = origin.is_finite() && direction.is_finite() && direction[major] != 0.0 && t_max > 0.0;
        if !usable {
            return None;
        }
        let (mut a, mut b) = ((major + 1) % 3, (major + 2) % 3);
        if direction[major] < 0.0 {
            (a, b) = (b, a);
        }
        let inverse = direction.recip();
        let scale = inverse[major];
        Some(Self {
            origin,
            direction,
            inverse,
            t_max,
            backward: inverse.to_array().map(|x| x.is_sign_negative() as usize),
            axes: [a, b, major],
            shear: [direction[a] / direction[major], direction[b] / direction[major], scale],
        })
    }

    /// The same ray in another space. The direction is not normalised, so distances are the same.
    #[inline]
    pub fn transformed(&self, to_local: &DAffine3) -> Option<Self> {
        Self::new(
            to_local.transform_point3(self.origin.as_dvec3()).as_vec3(),
            to_local.transform_vector3(self.direction.as_dvec3()).as_vec3(),
            self.t_max,
        )
    }
}

/// What the leaves of a hierarchy hold.
pub trait Leaves {
    /// Tests a leaf, lowers `ray.t_max` to what it finds; `true` ends the walk.
    fn test(&mut self, leaf: u32, ray: &mut TraversalRay) -> bool;
}

/// Calls `leaves` for every leaf whose box the ray enters before its `t_max`, roughly in order.
#[inline(always)]
pub fn traverse(bvh: &Bvh, ray: &mut TraversalRay, leaves: &mut impl Leaves) {
    if bvh.nodes.is_empty() {
        return;
    }
    let mut stack = Stack::new();
    let mut current = 0;
    loop {
        if current & LEAF != 0 {
            if leaves.test(current & !LEAF, ray) {
                return;
            }
        } else {
            let node = &bvh.nodes[current as usize];
            let (entry, mut entered) = enter(node, ray);
            let mut sorted = [0; WIDTH];
            let mut count = 0;
            while entered != 0 {
                let lane = entered.trailing_zeros() as usize % WIDTH;
                entered &= entered - 1;
                // Farthest first.
                let visit = Visit::new(entry[lane], node.children[lane]);
                let mut place = count;
                while place > 0 && sorted[place - 1] < visit.0 {
                    sorted[place] = sorted[place - 1];
                    place -= 1;
                }
                sorted[place] = visit.0;
                count += 1;
            }
            for &visit in &sorted[..count] {
                stack.push(Visit(visit));
            }
        }
        loop {
            let Some(visit) = stack.pop() else { return };
            if visit.entry() <= ray.t_max {
                current = visit.child();
                break;
            }
        }
    }
}

/// Distances at which the ray enters the children's boxes, and a bit for each that it does enter.
#[inline(always)]
fn enter(node: &Node, ray: &TraversalRay) -> ([f32; WIDTH], u32) {
    let mut near = [0.0; WIDTH];
    let mut far = [ray.t_max; WIDTH];
    for axis in 0..3 {
        let front = &node.planes[2 * axis + ray.backward[axis]];
        let back = &node.planes[2 * axis + 1 - ray.backward[axis]];
        let (origin, inverse) = (ray.origin[axis], ray.inverse[axis]);
        for lane in 0..WIDTH {
            // A ray within a plane gives NaN, which these comparisons ignore.
            let first = (front[lane] - origin) * inverse;
            let last = (back[lane] - origin) * inverse;
            near[lane] = if first > near[lane] { first } else { near[lane] };
            far[lane] = if last < far[lane] { last } else { far[lane] };
        }
    }
    let mut entered = 0;
    for lane in 0..WIDTH {
        entered |= ((near[lane] <= far[lane] * SLAB_WIDENING) as u32) << lane;
    }
    (near, entered)
}

/// A node to visit: entry distance above, child reference below, ordered by distance. The bits of
/// floats that are not negative are ordered as the floats are.
#[derive(Clone, Copy)]
struct Visit(u64);

impl Visit {
    #[inline(always)]
    fn new(entry: f32, child: u32) -> Self {
        Self((entry.to_bits() as u64) << 32 | child as u64)
    }

    #[inline(always)]
    fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn child(self) -> u32 {
        self.0 as u32
    }
}

struct Stack {
    near: [u64; STACK_SIZE],
    len: usize,
    spilled: Vec<u64>,
}

impl Stack {
    #[inline(always)]
    fn new() -> Self {
        Self { near: [0; STACK_SIZE], len: 0, spilled: Vec::new() }
    }

    #[inline(always)]
    fn push(&mut self, visit: Visit) {
        if self.len < STACK_SIZE {
            self.near[self.len] = visit.0;
            self.len += 1;
        } else {
            self.spilled.push(visit.0);
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<Visit> {
        if self.len == STACK_SIZE
            && let Some(visit) = self.spilled.pop()
        {
            return Some(Visit(visit));
        }
        self.len = self.len.checked_sub(1)?;
        self.near.get(self.len).map(|&visit| Visit(visit))
    }
}
