//! Intersects a ray with the eight boxes of a node, or with the eight triangles of a leaf.
//!
//! Both tests exist as portable code and with AVX2 instructions ([`avx2`]). Both versions do the
//! same operations in the same order, none of them fused, and so give the same bits.

#[cfg(target_arch = "x86_64")]
pub mod avx2;

use glam::Vec2;

use super::bvh::{Node, WIDTH};
use super::rounding::gamma;
use super::traversal_ray::TraversalRay;
use super::triangle::{TriangleHit, TrianglePacket};

/// The box test and the triangle test in one instruction set.
pub trait Kernels: Copy {
    /// See [`intersect_boxes`].
    fn intersect_boxes(self, node: &Node, ray: &TraversalRay) -> BoxHits;
    /// See [`intersect_triangles`].
    fn intersect_triangles(self, packet: &TrianglePacket, ray: &TraversalRay) -> Option<TriangleCandidates>;
}

/// A pair of functions. Closures inherit the instruction set of the function that they are written
/// in.
impl<B, T> Kernels for (B, T)
where
    B: Fn(&Node, &TraversalRay) -> BoxHits + Copy,
    T: Fn(&TrianglePacket, &TraversalRay) -> Option<TriangleCandidates> + Copy,
{
    #[inline(always)]
    fn intersect_boxes(self, node: &Node, ray: &TraversalRay) -> BoxHits {
        self.0(node, ray)
    }

    #[inline(always)]
    fn intersect_triangles(self, packet: &TrianglePacket, ray: &TraversalRay) -> Option<TriangleCandidates> {
        self.1(packet, ray)
    }
}

/// Factor on the distance at which a ray leaves a box. It covers the rounding of the slab test
/// (2γ(3), Ize 2013) and of the triangle test's shear, so that a ray enters the box of every
/// triangle that it hits. A box entered in vain costs time only.
const SLAB_WIDENING: f32 = 1.0 + 2.0 * gamma(16);

/// The children of a node that a ray enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxHits {
    /// A bit for each child.
    pub mask: u32,
    /// Distance at which the ray enters each child; meaningful where the bit is set.
    pub t_near: [f32; WIDTH],
}

/// Tests the eight boxes of a node (slab test).
#[inline(always)]
pub fn intersect_boxes(node: &Node, ray: &TraversalRay) -> BoxHits {
    let mut t_near = [0.0; WIDTH];
    let mut t_far = [ray.t_max; WIDTH];
    for (axis, planes) in node.planes.iter().enumerate() {
        let (origin, inverse) = (ray.origin[axis], ray.inverse_direction[axis]);
        let near_plane = &planes[ray.direction_is_negative[axis] & 1];
        let far_plane = &planes[!ray.direction_is_negative[axis] & 1];
        for lane in 0..WIDTH {
            // A ray within a plane gives NaN, which these comparisons ignore.
            let enters = (near_plane[lane] - origin) * inverse;
            let leaves = (far_plane[lane] - origin) * inverse;
            t_near[lane] = if enters > t_near[lane] { enters } else { t_near[lane] };
            t_far[lane] = if leaves < t_far[lane] { leaves } else { t_far[lane] };
        }
    }
    let mut mask = 0;
    for lane in 0..WIDTH {
        mask |= ((t_near[lane] <= t_far[lane] * SLAB_WIDENING) as u32) << lane;
    }
    BoxHits { mask, t_near }
}

/// Triangles of a packet that the ray may hit.
#[derive(Clone, Copy, Debug)]
pub struct TriangleCandidates {
    /// A bit for each candidate. Every triangle that is hit is among them.
    pub mask: u32,
    /// A bit for each candidate that is hit for certain if its distance is still below the ray's
    /// `t_max`; [`TrianglePacket::hit`] decides on the others.
    pub certain: u32,
    pub t: [f32; WIDTH],
    /// Edge functions of vertices 1 and 2, and the sum of all three, which normalises them.
    pub edges: [[f32; WIDTH]; 3],
}

impl TriangleCandidates {
    /// The hit of a lane in `certain`.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> TriangleHit {
        let [v, w, determinant] = self.edges.map(|lanes| lanes[lane]);
        TriangleHit { t: self.t[lane], barycentric: Vec2::new(v, w) / determinant }
    }
}

/// Tests the eight triangles of a packet; `None` if the ray hits none of them.
#[inline(always)]
pub fn intersect_triangles(packet: &TrianglePacket, ray: &TraversalRay) -> Option<TriangleCandidates> {
    let lanes = [0.0; WIDTH];
    let mut found = TriangleCandidates { mask: 0, certain: 0, t: lanes, edges: [lanes; 3] };
    for lane in 0..WIDTH {
        let sheared = packet.sheared(ray, lane);
        let [u, v, w] = sheared.edges();
        let inside = (u.min(v).min(w) >= 0.0) | (u.max(v).max(w) <= 0.0);
        let on_edge = (u == 0.0) | (v == 0.0) | (w == 0.0);
        let determinant = u + v + w;
        let t = sheared.scaled_t([u, v, w], ray) / determinant;
        let in_range = (t > 0.0) & (t < ray.t_max);
        let certain = !on_edge & sheared.is_ahead_of(ray);
        found.mask |= ((inside & (on_edge | in_range)) as u32) << lane;
        found.certain |= (certain as u32) << lane;
        found.t[lane] = t;
        [found.edges[0][lane], found.edges[1][lane], found.edges[2][lane]] = [v, w, determinant];
    }
    (found.mask != 0).then_some(found)
}
