//! Watertight ray-triangle intersection, eight triangles at a time.
//!
//! Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection": in a space sheared so that
//! the ray is an axis, the signs of three edge functions decide, and triangles that share an edge
//! compute the very same number for it. The bound on the distance's error is pbrt-v4's (6.8.3).

use glam::{Vec2, Vec3};

use super::bvh::WIDTH;
use super::rounding::gamma;
use super::traverse::TraversalRay;

/// Corners of eight triangles: `corners[corner][axis][lane]`. Lanes without a triangle are NaN,
/// which no test passes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct TrianglePacket {
    corners: [[[f32; WIDTH]; 3]; 3],
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub struct TriangleHit {
    pub t: f32,
    /// Weights of vertices 1 and 2.
    pub barycentric: Vec2,
}

/// The result of testing a ray against a packet, before the rare checks of [`TriangleLanes::hit`].
pub struct TriangleLanes {
    /// A bit for each lane that may be hit.
    pub candidates: u32,
    /// Edge functions, which weigh the three corners.
    edges: [[f32; WIDTH]; 3],
    determinant: [f32; WIDTH],
    /// Distance times the determinant.
    scaled_t: [f32; WIDTH],
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

    /// Tests all lanes. Distances compare with the ray's `t_max`.
    #[inline(always)]
    pub fn intersect(&self, ray: &TraversalRay) -> TriangleLanes {
        let (x, y, z) = self.sheared(ray);
        let mut edges = [[0.0; WIDTH]; 3];
        for corner in 0..3 {
            let (b, c) = ((corner + 2) % 3, (corner + 1) % 3);
            for lane in 0..WIDTH {
                edges[corner][lane] = x[b][lane] * y[c][lane] - y[b][lane] * x[c][lane];
            }
        }
        let mut touched = false;
        for lane in 0..WIDTH {
            touched |= (edges[0][lane] == 0.0) | (edges[1][lane] == 0.0) | (edges[2][lane] == 0.0);
        }
        if touched {
            recompute_in_double(&x, &y, &mut edges);
        }

        let mut determinant = [0.0; WIDTH];
        let mut scaled_t = [0.0; WIDTH];
        let mut candidates = 0;
        for lane in 0..WIDTH {
            let [u, v, w] = [edges[0][lane], edges[1][lane], edges[2][lane]];
            determinant[lane] = u + v + w;
            scaled_t[lane] = ray.shear[2] * (u * z[0][lane] + v * z[1][lane] + w * z[2][lane]);
            let t = scaled_t[lane] / determinant[lane];
            let inside = ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0));
            let counts = inside & (determinant[lane] != 0.0) & (t > 0.0) & (t < ray.t_max);
            candidates |= (counts as u32) << lane;
        }
        TriangleLanes { candidates, edges, determinant, scaled_t }
    }

    /// Corner coordinates relative to the ray, the first two sheared: `[corner][lane]` each.
    #[inline(always)]
    fn sheared(&self, ray: &TraversalRay) -> ([[f32; WIDTH]; 3], [[f32; WIDTH]; 3], [[f32; WIDTH]; 3]) {
        let [a, b, major] = ray.axes;
        let origin = [ray.origin[a], ray.origin[b], ray.origin[major]];
        let (mut x, mut y, mut z) = ([[0.0; WIDTH]; 3], [[0.0; WIDTH]; 3], [[0.0; WIDTH]; 3]);
        for corner in 0..3 {
            let planes = &self.corners[corner];
            let (from_x, from_y, from_z) = (&planes[a], &planes[b], &planes[major]);
            for lane in 0..WIDTH {
                z[corner][lane] = from_z[lane] - origin[2];
                x[corner][lane] = (from_x[lane] - origin[0]) - ray.shear[0] * z[corner][lane];
                y[corner][lane] = (from_y[lane] - origin[1]) - ray.shear[1] * z[corner][lane];
            }
        }
        (x, y, z)
    }

    /// The hit of a candidate lane, unless it may lie behind the origin by rounding.
    #[inline]
    pub fn hit(&self, ray: &TraversalRay, lanes: &TriangleLanes, lane: usize) -> Option<TriangleHit> {
        let determinant = lanes.determinant[lane];
        let t = lanes.scaled_t[lane] / determinant;
        let (x, y, z) = self.sheared(ray);
        let [x, y, z] = [x, y, z].map(|planes| planes.map(|plane| plane[lane]));
        // All corners ahead leave no doubt about the sign of t.
        let ahead = z.iter().all(|&z| z * ray.shear[2] > 0.0);
        if !ahead {
            let largest = |values: [f32; 3]| values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            let [size_x, size_y, size_z] = [largest(x), largest(y), largest(z)];
            let size_edge = largest(lanes.edges.map(|edge| edge[lane]));
            let error_z = gamma(3) * size_z;
            let error_x = gamma(5) * (size_x + size_z);
            let error_y = gamma(5) * (size_y + size_z);
            let error_edge = 2.0 * (gamma(2) * size_x * size_y + error_y * size_x + error_x * size_y);
            let error_sum = gamma(3) * size_edge * size_z + error_edge * size_z + error_z * size_edge;
            if t <= 3.0 * error_sum * (ray.shear[2] / determinant).abs() {
                return None;
            }
        }
        let barycentric = Vec2::new(lanes.edges[1][lane], lanes.edges[2][lane]) / determinant;
        Some(TriangleHit { t, barycentric })
    }
}

/// Edge functions that came out as zero, again from exact products: only then is their sign sure.
#[cold]
#[inline(never)]
fn recompute_in_double(x: &[[f32; WIDTH]; 3], y: &[[f32; WIDTH]; 3], edges: &mut [[f32; WIDTH]; 3]) {
    for lane in 0..WIDTH {
        if edges.iter().any(|edge| edge[lane] == 0.0) {
            for (corner, edge) in edges.iter_mut().enumerate() {
                let (b, c) = ((corner + 2) % 3, (corner + 1) % 3);
                let double = |value: f32| value as f64;
                edge[lane] = (double(x[b][lane]) * double(y[c][lane])
                    - double(y[b][lane]) * double(x[c][lane])) as f32;
            }
        }
    }
}
