//! Samples points on an emissive triangle, or on a parallelogram of two triangles, uniformly by area
//! (pbrt-v4, section 6.5.4). Everything that does not depend on the point is precomputed.

use glam::{Vec2, Vec3};

use super::mesh;
use super::rounding::gamma;
use super::shape_sample::ShapeSample;
use crate::scene::TriangleMesh;

/// A triangle or parallelogram of a mesh, ready to be sampled.
#[derive(Clone, Debug)]
pub struct TriangleSampler {
    /// The corner that both `edges` start from.
    corner: Vec3,
    edges: [Vec3; 2],
    /// Unit geometric normal.
    normal: Vec3,
    inverse_area: f32,
    position_error: Vec3,
    /// Texture coordinates at `corner` and at the ends of `edges`.
    uvs: [Vec2; 3],
    is_parallelogram: bool,
    /// Vertex normals, if they lie on both sides of the triangle's plane.
    two_sided_normals: Option<Box<[Vec3; 3]>>,
}

impl TriangleSampler {
    /// A triangle of a mesh. The vertex normals choose the side of the normal, or the winding and
    /// `flip_normal` if there are none.
    pub fn new(mesh: &TriangleMesh, triangle: u32, flip_normal: bool) -> Self {
        let [a, b, c] = mesh::corners(mesh, triangle);
        let scaled_normal = mesh::scaled_normal([a, b, c]);
        let winding = scaled_normal.normalize_or_zero().as_vec3();
        let vertex_normals = mesh::corner_normals(mesh, triangle);
        let behind = match vertex_normals {
            None => [flip_normal; 3],
            Some(normals) => normals.map(|normal| winding.dot(normal) < 0.0),
        };
        let agree = behind[0] == behind[1] && behind[1] == behind[2];
        let edges = [b - a, c - a];
        Self {
            corner: a,
            edges,
            normal: if agree && behind[0] { -winding } else { winding },
            inverse_area: (2.0 / scaled_normal.length()) as f32,
            // γ(4) bounds the rounding of the edges, two products and two sums.
            position_error: gamma(4) * (a.abs() + edges[0].abs() + edges[1].abs()),
            uvs: mesh::corner_uvs(mesh, triangle),
            is_parallelogram: false,
            two_sided_normals: vertex_normals.filter(|_| !agree).map(Box::new),
        }
    }

    /// Two triangles of a mesh that form a parallelogram; `None` if they do not. The texture
    /// coordinates of the first triangle are extrapolated to the second.
    pub fn new_parallelogram(mesh: &TriangleMesh, triangles: [u32; 2], flip_normal: bool) -> Option<Self> {
        let [first, second] = triangles.map(|triangle| Self::new(mesh, triangle, flip_normal));
        let [p, q] = triangles.map(|triangle| mesh::corners(mesh, triangle));
        let one_sided = first.has_constant_normal() && second.has_constant_normal();
        if !one_sided || first.normal.dot(second.normal) <= 0.0 {
            return None;
        }
        // Corner `a` of the first triangle and corner `d` of the second are opposite to the shared edge.
        (0..3).find_map(|a| {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            let d = (0..3).find(|&d| q[(d + 1) % 3] == p[c] && q[(d + 2) % 3] == p[b])?;
            let gap = (p[b] + p[c] - p[a] - q[d]).abs();
            let closes = gap.cmple(first.position_error).all();
            closes.then(|| Self {
                corner: p[a],
                edges: [p[b] - p[a], p[c] - p[a]],
                inverse_area: 1.0 / (first.inverse_area.recip() + second.inverse_area.recip()),
                position_error: gap + first.position_error + second.position_error,
                uvs: [first.uvs[a], first.uvs[b], first.uvs[c]],
                is_parallelogram: true,
                ..first.clone()
            })
        })
    }

    /// Centroid of the triangle or parallelogram.
    pub fn centroid(&self) -> Vec3 {
        let fraction = if self.is_parallelogram { 0.5 } else { 1.0 / 3.0 };
        self.corner + fraction * (self.edges[0] + self.edges[1])
    }

    /// Samples a point as seen from `reference`, with `u` in [0, 1)²; `None` if the triangle has no
    /// area, or is seen edge-on.
    #[inline]
    pub fn sample(&self, reference: Vec3, u: Vec2) -> Option<ShapeSample> {
        let (position, b) = self.point(u);
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let normal = match &self.two_sided_normals {
            None => self.normal,
            Some(n) => {
                let interpolated = weights[0] * n[0] + weights[1] * n[1] + weights[2] * n[2];
                if interpolated.dot(self.normal) < 0.0 { -self.normal } else { self.normal }
            }
        };
        let pdf = self.pdf(reference, position);
        (pdf > 0.0).then(|| ShapeSample {
            position,
            position_error: self.position_error,
            normal,
            uv: weights[0] * self.uvs[0] + weights[1] * self.uvs[1] + weights[2] * self.uvs[2],
            pdf,
        })
    }

    /// Samples a point uniformly by area; returns it with its coordinates along the edges.
    #[inline(always)]
    pub fn point(&self, u: Vec2) -> (Vec3, Vec2) {
        let barycentric = uniform_barycentric(u);
        let b = if self.is_parallelogram { u } else { barycentric };
        (self.corner + b.x * self.edges[0] + b.y * self.edges[1], b)
    }

    /// Whether the normal is [`Self::normal`] at every point.
    #[inline]
    pub fn has_constant_normal(&self) -> bool {
        self.two_sided_normals.is_none()
    }

    /// Unit geometric normal.
    #[inline(always)]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Bound on the error of a sampled position, per axis.
    #[inline(always)]
    pub fn position_error(&self) -> Vec3 {
        self.position_error
    }

    /// Density with respect to solid angle with which [`Self::sample`] samples the direction from
    /// `reference` to `position`, a point of the triangle; 0 if it never does.
    #[inline(always)]
    pub fn pdf(&self, reference: Vec3, position: Vec3) -> f32 {
        let to_point = position - reference;
        let squared = to_point.length_squared();
        let pdf = squared * squared.sqrt() / to_point.dot(self.normal).abs() * self.inverse_area;
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}

/// Barycentric coordinates of vertices 1 and 2, uniform by area. This mapping (Heitz 2019) preserves
/// the stratification of `u` better than the one with a square root.
#[inline(always)]
fn uniform_barycentric(u: Vec2) -> Vec2 {
    let (b0, b1) = if u.x < u.y { (0.5 * u.x, u.y - 0.5 * u.x) } else { (u.x - 0.5 * u.y, 0.5 * u.y) };
    Vec2::new(b1, 1.0 - b0 - b1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::test_scenes::triangle_mesh;

    const CORNERS: [Vec3; 4] =
        [Vec3::ZERO, Vec3::new(2.0, 0.0, 1.0), Vec3::new(2.5, 3.0, 2.0), Vec3::new(0.5, 3.0, 1.0)];

    fn parallelogram(triangles: [[Vec3; 3]; 2], flip_normal: bool) -> Option<TriangleSampler> {
        TriangleSampler::new_parallelogram(&triangle_mesh(&triangles), [0, 1], flip_normal)
    }

    #[test]
    fn halves_of_a_parallelogram_are_sampled_as_one() {
        let [a, b, c, d] = CORNERS;
        let reference = Vec3::new(0.3, 0.2, 9.0);
        for halves in [[[a, b, c], [a, c, d]], [[b, c, a], [d, a, c]], [[b, c, d], [b, d, a]]] {
            let both = parallelogram(halves, true).expect("a parallelogram");
            let mesh = triangle_mesh(&halves);
            let single = TriangleSampler::new(&mesh, 0, true);
            assert!((both.centroid() - 0.5 * (a + c)).length() < 1e-6);
            let n = 16;
            let mut mean = Vec3::ZERO;
            for i in 0..n * n {
                let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
                let sample = both.sample(reference, u).expect("it is visible");
                assert!((sample.normal - single.normal).length() < 1e-6);
                // Twice the area halves the density.
                let expected = 0.5 * single.pdf(reference, sample.position);
                assert!((sample.pdf / expected - 1.0).abs() < 1e-4);
                mean += sample.position / (n * n) as f32;
            }
            assert!((mean - both.centroid()).length() < 1e-4);
        }
    }

    #[test]
    fn other_pairs_of_triangles_are_not_merged() {
        let [a, b, c, d] = CORNERS;
        let lifted = d + 0.01 * Vec3::Z;
        for halves in [
            [[a, b, c], [a, c, lifted]],
            [[a, b, c], [a, c, 0.9 * d]],
            // The second triangle faces the other way.
            [[a, b, c], [c, a, d]],
            [[a, b, c], [a, b, c]],
        ] {
            assert!(parallelogram(halves, false).is_none(), "{halves:?}");
        }
    }
}
