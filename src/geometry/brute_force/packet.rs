//! Sixteen rays in lanes, and their tests against one surface.

use glam::{DVec3, Vec3};

use super::surfaces::{FullSphere, Triangle};
use crate::geometry::lanes::RayLanes;
use crate::geometry::rounding::gamma;
use crate::geometry::sphere;
use crate::simd::{LANES, Lanes, lane_mask};

/// Index of no surface.
pub const NO_SURFACE: u32 = u32::MAX;

/// Rays in lanes, and their nearest hits.
pub struct RayPacket {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    /// Axis of the largest direction component, and shear and scale along it as in
    /// [`TraversalRay`](crate::geometry::traversal_ray::TraversalRay). Axes are permuted cyclically,
    /// which may change the handedness; the tests accept both windings, so the results are the same.
    major: Lanes<u32>,
    shear: [Lanes; 2],
    scale: Lanes,
    /// Largest magnitude of the origin's coordinates.
    reach: Lanes,
    pub nearest: NearestHits,
}

/// The nearest hits of the rays so far.
#[derive(Clone, Copy)]
pub struct NearestHits {
    pub t_max: Lanes,
    /// Index of the surface, triangles before spheres; [`NO_SURFACE`] for no hit.
    pub surface: Lanes<u32>,
    /// Edge functions of vertices 1 and 2, and the sum of all three, which normalises them.
    edges: [Lanes; 3],
    /// Barycentric coordinates of vertices 1 and 2; 0 on spheres.
    pub barycentric: [Lanes; 2],
    /// Nonzero in lanes that need the precision of the hierarchy's test.
    undecided: Lanes<u32>,
}

impl RayPacket {
    /// The first `count` rays; the other lanes hit nothing.
    pub fn new(rays: &RayLanes, count: usize) -> Self {
        let zero = [0.0; LANES];
        let none = [0; LANES];
        let (o, d) = (&rays.origin, &rays.direction);
        let mut t_max = rays.t_max;
        t_max[count..].fill(0.0);
        Self {
            origin: [o.x, o.y, o.z],
            direction: [d.x, d.y, d.z],
            major: none,
            shear: [zero; 2],
            scale: zero,
            reach: zero,
            nearest: NearestHits {
                t_max,
                surface: [NO_SURFACE; LANES],
                edges: [zero; 3],
                barycentric: [zero; 2],
                undecided: none,
            },
        }
    }

    /// Computes the shears, and the largest magnitude of each origin's coordinates.
    #[inline(always)]
    pub fn prepare(&mut self) {
        for lane in 0..LANES {
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let x_is_major = (d_x.abs() > d_y.abs()) & (d_x.abs() > d_z.abs());
            let y_or_z = if d_y.abs() > d_z.abs() { 1 } else { 2 };
            self.major[lane] = if x_is_major { 0 } else { y_or_z };
        }
        // One loop for this and the above would not become vector code.
        for lane in 0..LANES {
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let [along, a, b] = rotate_axes([d_x, d_y, d_z], self.major[lane]);
            // Zero times infinity or NaN is NaN.
            let zero_if_finite = 0.0 * o_x + 0.0 * o_y + 0.0 * o_z + 0.0 * d_x + 0.0 * d_y + 0.0 * d_z;
            let scale = 1.0 / along;
            self.shear[0][lane] = a * scale;
            self.shear[1][lane] = b * scale;
            self.scale[lane] = scale;
            self.reach[lane] = max(o_x.abs(), max(o_y.abs(), o_z.abs()));
            let t_max = self.nearest.t_max[lane];
            self.nearest.t_max[lane] = if (zero_if_finite == 0.0) & (along != 0.0) { t_max } else { 0.0 };
        }
    }

    /// Tests a triangle. Lanes with a hit so close to the origin that its side is not certain are undecided.
    #[inline(always)]
    pub fn intersect_triangle(&self, nearest: &mut NearestHits, triangle: &Triangle, index: u32) {
        for lane in 0..LANES {
            // Shear the corners so that the ray runs along the major axis
            let major = self.major[lane];
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [shear_x, shear_y] = [self.shear[0][lane], self.shear[1][lane]];
            let sheared = |p: Vec3| {
                let [along, a, b] = rotate_axes([p.x - o_x, p.y - o_y, p.z - o_z], major);
                [a - shear_x * along, b - shear_y * along, along]
            };
            let [corner_0, corner_1, corner_2] = triangle.corners;
            let [x_0, y_0, z_0] = sheared(corner_0);
            let [x_1, y_1, z_1] = sheared(corner_1);
            let [x_2, y_2, z_2] = sheared(corner_2);

            // Compute the edge functions, and test their signs
            let u = x_2 * y_1 - y_2 * x_1;
            let v = x_0 * y_2 - y_0 * x_2;
            let w = x_1 * y_0 - y_1 * x_0;
            let (least, greatest) = (min(u, min(v, w)), max(u, max(v, w)));
            let inside = (least > 0.0) | (greatest < 0.0);
            let on_edge = (least == 0.0) | (greatest == 0.0);

            // Compute the distance, and test whether it is in range
            let determinant = u + v + w;
            let weighted = u * z_0 + v * z_1 + w * z_2;
            let t = weighted * self.scale[lane] / determinant;
            let t_max = nearest.t_max[lane];
            let in_range = (t > 0.0) & (t < t_max);

            // Store the hit where it is the nearest
            let is_certain = weighted.abs() > uncertain_distance(self.reach[lane] + triangle.size);
            let hits = inside & in_range & is_certain;
            let is_undecided = on_edge & (t_max > 0.0) | inside & in_range & !is_certain;
            nearest.undecided[lane] |= is_undecided as u32;
            nearest.t_max[lane] = if hits { t } else { t_max };
            nearest.surface[lane] = if hits { index } else { nearest.surface[lane] };
            nearest.edges[0][lane] = if hits { v } else { nearest.edges[0][lane] };
            nearest.edges[1][lane] = if hits { w } else { nearest.edges[1][lane] };
            nearest.edges[2][lane] = if hits { determinant } else { nearest.edges[2][lane] };
        }
    }

    /// Whether some ray may hit the bounding sphere of `sphere`. The test is conservative by far more
    /// than its rounding.
    #[inline(always)]
    pub fn may_hit(&self, nearest: &NearestHits, sphere: &FullSphere) -> bool {
        let (centre, radius) = (sphere.centre, sphere.bounding_radius);
        let squared_radius = radius * radius * (1.0 + 1e-4) + 1e-5 * centre.length_squared();
        let mut may = 0;
        for lane in 0..LANES {
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let [x, y, z] = [centre.x - o_x, centre.y - o_y, centre.z - o_z];
            let along = x * d_x + y * d_y + z * d_z;
            let squared = x * x + y * y + z * z;
            let limit = squared_radius + 1e-5 * (squared + o_x * o_x + o_y * o_y + o_z * o_z);
            // The sphere is beside the ray, or behind its origin.
            let squared_length = d_x * d_x + d_y * d_y + d_z * d_z;
            let misses =
                (squared - along * along / squared_length > limit) | ((along < 0.0) & (squared > limit));
            may |= u32::from(!misses & (nearest.t_max[lane] > 0.0));
        }
        may != 0
    }

    /// Tests a full sphere.
    #[inline(always)]
    pub fn intersect_sphere(&self, nearest: &mut NearestHits, sphere: &FullSphere, index: u32) {
        for lane in 0..LANES {
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let origin = sphere.to_shape.transform_point3(DVec3::new(o_x.into(), o_y.into(), o_z.into()));
            let direction = sphere.to_shape.transform_vector3(DVec3::new(d_x.into(), d_y.into(), d_z.into()));
            let [first, last] = sphere::distances(sphere.radius, origin, direction);
            let (first, last) = (first as f32, last as f32);
            // NaN fails the comparisons and is a miss.
            let t = if first > 0.0 { first } else { last };
            let t_max = nearest.t_max[lane];
            let hits = (t > 0.0) & (t < t_max);
            nearest.t_max[lane] = if hits { t } else { t_max };
            nearest.surface[lane] = if hits { index } else { nearest.surface[lane] };
        }
    }
}

impl NearestHits {
    /// The mask of the lanes that need the precision of the hierarchy's test.
    pub fn undecided(&self) -> u32 {
        lane_mask(|lane| self.undecided[lane] != 0)
    }

    /// Computes the barycentric coordinates from the edge functions. The first `triangle_count`
    /// surfaces are triangles.
    #[inline(always)]
    pub fn normalise_barycentric(&mut self, triangle_count: u32) {
        for lane in 0..LANES {
            let is_triangle = self.surface[lane] < triangle_count;
            let determinant = self.edges[2][lane];
            let [v, w] = [self.edges[0][lane] / determinant, self.edges[1][lane] / determinant];
            self.barycentric[0][lane] = if is_triangle { v } else { 0.0 };
            self.barycentric[1][lane] = if is_triangle { w } else { 0.0 };
        }
    }
}

/// Permutes the components cyclically so that the one of axis `major` is the first.
#[inline(always)]
fn rotate_axes([x, y, z]: [f32; 3], major: u32) -> [f32; 3] {
    let pick = |x, y, z| {
        if major == 0 {
            x
        } else if major == 1 {
            y
        } else {
            z
        }
    };
    [pick(x, y, z), pick(y, z, x), pick(z, x, y)]
}

/// Bound on the weighted distance, the distance along the major axis times the sum of the edge functions, up to which its sign is not
/// certain: three times the bound on its error (pbrt-v4, section 6.8.3). `reach` bounds the coordinates of the triangle relative to
/// the origin. Shearing at most doubles them, and an edge function is at most eight times their product.
#[inline(always)]
fn uncertain_distance(reach: f32) -> f32 {
    const FACTOR: f32 = 3.0 * (16.0 * gamma(3) + 8.0 * gamma(2) + 24.0 * gamma(5));
    FACTOR * (reach * reach * reach)
}

/// [`f32::min`] without its treatment of NaN, in one instruction.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// [`f32::max`] without its treatment of NaN, in one instruction.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
