//! Watertight ray-triangle intersection, eight triangles at a time.
//!
//! The test shears space so that the ray runs along an axis, and decides by the signs of three edge
//! functions. Triangles that share an edge compute the same value for it, so no ray passes between
//! them (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection").
//!
//! Whether a triangle lies ahead of a ray's origin or behind it is decided in double precision, unless all of its corners are ahead. A
//! bound on the error of the distance in single precision, such as pbrt-v4's (section 6.8.3), grows with the triangle: it would let
//! steep rays through a ground of 10⁵ units that begin within 0.2 units of it. The distance has to be positive as well, so that rays that
//! graze such a ground from within some hundredths of a unit may still pass, and so may rays at the edges of triangles of 10⁴ by 1 units.

use glam::{Vec2, Vec3};

use super::bvh::WIDTH;
use super::traversal_ray::TraversalRay;

/// Corners of eight triangles: `corners[corner][axis][lane]`. Lanes without a triangle are NaN,
/// which every test takes for a miss.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct TrianglePacket {
    pub corners: [[[f32; WIDTH]; 3]; 3],
}

/// Distance and position of a hit on a triangle.
#[derive(Clone, Copy, Debug)]
pub struct TriangleHit {
    pub t: f32,
    /// Barycentric coordinates of vertices 1 and 2.
    pub barycentric: Vec2,
}

/// A triangle's corners in the sheared space of a ray, as `x[corner]`, `y[corner]` and `z[corner]`.
/// The ray runs along z from the origin; z is not scaled.
pub struct ShearedTriangle {
    x: [f32; 3],
    y: [f32; 3],
    z: [f32; 3],
}

impl TrianglePacket {
    pub const EMPTY: Self = Self { corners: [[[f32::NAN; WIDTH]; 3]; 3] };

    pub fn set(&mut self, lane: usize, corners: [Vec3; 3]) {
        for (planes, corner) in self.corners.iter_mut().zip(corners) {
            for (axis, plane) in planes.iter_mut().enumerate() {
                plane[lane] = corner[axis];
            }
        }
    }

    /// The triangle of one lane in the sheared space of `ray`.
    #[inline(always)]
    pub fn sheared(&self, ray: &TraversalRay, lane: usize) -> ShearedTriangle {
        let [a, b, major] = ray.axes;
        let z = self.corners.map(|planes| planes[major][lane] - ray.permuted_origin[2]);
        let along = |axis: usize, index: usize| {
            std::array::from_fn(|corner| {
                let centred = self.corners[corner][axis][lane] - ray.permuted_origin[index];
                centred - ray.shear[index] * z[corner]
            })
        };
        ShearedTriangle { x: along(a, 0), y: along(b, 1), z }
    }

    /// The hit on the triangle of one lane, if it is nearer than the ray's `t_max`.
    #[inline]
    pub fn hit(&self, ray: &TraversalRay, lane: usize) -> Option<TriangleHit> {
        let sheared = self.sheared(ray, lane);
        let mut edges = sheared.edges();
        if edges.contains(&0.0) {
            edges = sheared.edges_in_double();
        }
        let outside = edges.iter().any(|&edge| edge < 0.0) && edges.iter().any(|&edge| edge > 0.0);
        let determinant = edges[0] + edges[1] + edges[2];
        let t = sheared.scaled_t(edges, ray) / determinant;
        // NaN fails these comparisons and is a miss.
        let in_range = t > 0.0 && t < ray.t_max;
        let hits = !outside && in_range && (sheared.is_ahead_of(ray) || self.is_ahead_of(ray, lane));
        hits.then(|| TriangleHit { t, barycentric: Vec2::new(edges[1], edges[2]) / determinant })
    }
}

impl TrianglePacket {
    /// Whether the ray meets the plane of the triangle of one lane ahead of its origin.
    fn is_ahead_of(&self, ray: &TraversalRay, lane: usize) -> bool {
        let corners = self.corners.map(|planes| Vec3::from(planes.map(|plane| plane[lane])).as_dvec3());
        let [a, b, c] = corners.map(|corner| corner - ray.origin.as_dvec3());
        let normal = (b - a).cross(c - a);
        normal.dot(a) * normal.dot(ray.direction.as_dvec3()) > 0.0
    }
}

impl ShearedTriangle {
    /// Edge functions: barycentric coordinates of the three corners, not normalised.
    #[inline(always)]
    pub fn edges(&self) -> [f32; 3] {
        let Self { x, y, .. } = self;
        [x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]]
    }

    /// Edge functions from exact products. Single precision gives the right sign or zero, because
    /// rounding is monotonic, so only zeros need this.
    fn edges_in_double(&self) -> [f32; 3] {
        let [x, y] = [self.x, self.y].map(|values| values.map(f64::from));
        [x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]]
            .map(|edge| edge as f32)
    }

    /// Distance along the ray times the sum of the edge functions.
    #[inline(always)]
    pub fn scaled_t(&self, edges: [f32; 3], ray: &TraversalRay) -> f32 {
        (edges[0] * self.z[0] + edges[1] * self.z[1] + edges[2] * self.z[2]) * ray.scale
    }

    /// Whether all corners are ahead of the ray's origin.
    #[inline(always)]
    pub fn is_ahead_of(&self, ray: &TraversalRay) -> bool {
        let [a, b, c] = self.z.map(|z| z * ray.scale > 0.0);
        a & b & c
    }
}
