//! The two tests that work on eight lanes at once: boxes of a node, triangles of a leaf.
//!
//! Written once for any machine and once with AVX2. Both do the same operations in the same order,
//! none of them fused, and so give the same bits.

#[cfg(target_arch = "x86_64")]
pub mod avx2;

use glam::Vec2;

use super::bvh::{Node, WIDTH};
use super::rounding::gamma;
use super::traverse::TraversalRay;
use super::triangle::{TriangleHit, TrianglePacket};

/// The tests in one instruction set: for boxes and for triangles.
pub trait Kernels: Copy {
    /// See [`enter`].
    fn enter(self, node: &Node, ray: &TraversalRay) -> Entered;
    /// See [`candidates`].
    fn candidates(self, packet: &TrianglePacket, ray: &TraversalRay) -> Option<Candidates>;
}

/// A pair of functions, which inherit the instruction set from where they are written.
impl<E, C> Kernels for (E, C)
where
    E: Fn(&Node, &TraversalRay) -> Entered + Copy,
    C: Fn(&TrianglePacket, &TraversalRay) -> Option<Candidates> + Copy,
{
    #[inline(always)]
    fn enter(self, node: &Node, ray: &TraversalRay) -> Entered {
        self.0(node, ray)
    }

    #[inline(always)]
    fn candidates(self, packet: &TrianglePacket, ray: &TraversalRay) -> Option<Candidates> {
        self.1(packet, ray)
    }
}

/// Widening of a ray's interval in each box. It covers the rounding of the slab test (Ize 2013:
/// two of γ(3)) and that of the triangle test's shear, so that a ray enters every box with a
/// triangle that it hits; an unneeded visit costs nothing in correctness.
const SLAB_WIDENING: f32 = 1.0 + 2.0 * gamma(16);

/// Which children of a node a ray enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entered {
    /// A bit for each child.
    pub mask: u32,
    /// Distance of entry into each, meaningful where the bit is set.
    pub near: [f32; WIDTH],
}

/// The slab test of eight boxes.
#[inline(always)]
pub fn enter(node: &Node, ray: &TraversalRay) -> Entered {
    let mut near = [0.0; WIDTH];
    let mut far = [ray.t_max; WIDTH];
    for (axis, planes) in node.planes.iter().enumerate() {
        let (origin, inverse) = (ray.origin[axis], ray.inverse[axis]);
        let front = &planes[ray.backward[axis] & 1];
        let back = &planes[!ray.backward[axis] & 1];
        for lane in 0..WIDTH {
            // A ray within a plane gives NaN, which these comparisons ignore.
            let first = (front[lane] - origin) * inverse;
            let last = (back[lane] - origin) * inverse;
            near[lane] = if first > near[lane] { first } else { near[lane] };
            far[lane] = if last < far[lane] { last } else { far[lane] };
        }
    }
    let mut mask = 0;
    for lane in 0..WIDTH {
        mask |= ((near[lane] <= far[lane] * SLAB_WIDENING) as u32) << lane;
    }
    Entered { mask, near }
}

/// Triangles of a packet that may be hit.
#[derive(Clone, Copy, Debug)]
pub struct Candidates {
    /// A bit for each of them. All that are hit are among them.
    pub mask: u32,
    /// A bit for each that is hit beyond doubt, if its distance is still below the ray's `t_max`;
    /// for the others [`TrianglePacket::hit`] decides.
    pub sure: u32,
    pub t: [f32; WIDTH],
    /// Weights of vertices 1 and 2, and the sum that they are to be divided by.
    pub weights: [[f32; WIDTH]; 3],
}

impl Candidates {
    /// The hit of a lane that is sure.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> TriangleHit {
        let [v, w, determinant] = self.weights.map(|lanes| lanes[lane]);
        TriangleHit { t: self.t[lane], barycentric: Vec2::new(v, w) / determinant }
    }
}

/// Tests a packet; `None` if no triangle may be hit.
#[inline(always)]
pub fn candidates(packet: &TrianglePacket, ray: &TraversalRay) -> Option<Candidates> {
    let lanes = [0.0; WIDTH];
    let mut found = Candidates { mask: 0, sure: 0, t: lanes, weights: [lanes; 3] };
    for lane in 0..WIDTH {
        let sheared = packet.sheared(ray, lane);
        let [u, v, w] = sheared.edges();
        let inside = (u.min(v).min(w) >= 0.0) | (u.max(v).max(w) <= 0.0);
        let on_edge = (u == 0.0) | (v == 0.0) | (w == 0.0);
        let determinant = u + v + w;
        let t = sheared.scaled_t([u, v, w], ray) / determinant;
        let in_range = (t > 0.0) & (t < ray.t_max);
        let sure = !on_edge & sheared.is_ahead_of(ray);
        found.mask |= ((inside & (on_edge | in_range)) as u32) << lane;
        found.sure |= (sure as u32) << lane;
        found.t[lane] = t;
        [found.weights[0][lane], found.weights[1][lane], found.weights[2][lane]] = [v, w, determinant];
    }
    (found.mask != 0).then_some(found)
}
