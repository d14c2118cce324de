//! Points on an emissive triangle, uniform by area: all that does not depend on the point is
//! computed once.

use glam::{Vec2, Vec3};

use super::mesh;
use super::rounding::gamma;
use super::sampling::ShapeSample;
use crate::scene::TriangleMesh;

/// A triangle of a mesh, ready to be sampled.
#[derive(Clone, Debug)]
pub struct TriangleSampler {
    corner: Vec3,
    edges: [Vec3; 2],
    /// Unit geometric normal.
    normal: Vec3,
    inverse_area: f32,
    position_error: Vec3,
    uvs: [Vec2; 3],
    /// Vertex normals, where they disagree about the side of the geometric one.
    disagreeing: Option<Box<[Vec3; 3]>>,
}

impl TriangleSampler {
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
            // Of the edges, their products and two sums.
            position_error: gamma(4) * (a.abs() + edges[0].abs() + edges[1].abs()),
            uvs: mesh::corner_uvs(mesh, triangle),
            disagreeing: vertex_normals.filter(|_| !agree).map(Box::new),
        }
    }

    /// A point as seen from `reference`, with `u` in [0, 1)²; `None` if the triangle has no area,
    /// or is seen edge-on.
    #[inline]
    pub fn sample(&self, reference: Vec3, u: Vec2) -> Option<ShapeSample> {
        let b = uniform_barycentric(u);
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let position = self.corner + b.x * self.edges[0] + b.y * self.edges[1];
        let normal = match &self.disagreeing {
            None => self.normal,
            Some(n) => {
                let blended = weights[0] * n[0] + weights[1] * n[1] + weights[2] * n[2];
                if blended.dot(self.normal) < 0.0 { -self.normal } else { self.normal }
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

    /// Density by solid angle with which [`Self::sample`] draws the direction from `reference` to
    /// a point of the triangle; 0 if it never does.
    #[inline]
    pub fn pdf(&self, reference: Vec3, position: Vec3) -> f32 {
        let to_point = position - reference;
        let squared = to_point.length_squared();
        let pdf = squared * squared.sqrt() / to_point.dot(self.normal).abs() * self.inverse_area;
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}

/// Uniform by area (Heitz 2019): keeps the stratification of `u` better than a square root.
#[inline]
fn uniform_barycentric(u: Vec2) -> Vec2 {
    let (b0, b1) = if u.x < u.y { (0.5 * u.x, u.y - 0.5 * u.x) } else { (u.x - 0.5 * u.y, 0.5 * u.y) };
    Vec2::new(b1, 1.0 - b0 - b1)
}
