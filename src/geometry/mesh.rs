//! The surface of a triangle mesh, with pbrt-v4's conventions (section 6.5.3).

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::local::LocalPoint;
use super::rounding::gamma;
use crate::scene::TriangleMesh;

/// Texture coordinates of the corners of a triangle without any.
const DEFAULT_UVS: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::ONE];

/// Corners of a triangle.
pub fn corners(mesh: &TriangleMesh, triangle: u32) -> [Vec3; 3] {
    mesh.indices[triangle as usize].map(|index| mesh.positions[index as usize])
}

/// Texture coordinates at a point of a triangle.
pub fn uv(mesh: &TriangleMesh, triangle: u32, barycentric: Vec2) -> Vec2 {
    let [a, b, c] = corner_uvs(mesh, triangle);
    (1.0 - barycentric.x - barycentric.y) * a + barycentric.x * b + barycentric.y * c
}

fn corner_uvs(mesh: &TriangleMesh, triangle: u32) -> [Vec2; 3] {
    if mesh.uvs.is_empty() {
        DEFAULT_UVS
    } else {
        mesh.indices[triangle as usize].map(|index| mesh.uvs[index as usize])
    }
}

/// Twice the area times the unit normal; exact enough in double precision for any sliver.
pub fn scaled_normal(corners: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a)
}

/// The surface at a point of a triangle. A mesh with vertex normals takes their side; another's
/// side is that of its winding, or the opposite if `flip_normal`.
pub fn local_point(mesh: &TriangleMesh, triangle: u32, barycentric: Vec2, flip_normal: bool) -> LocalPoint {
    let points = corners(mesh, triangle);
    let corners = points.map(Vec3::as_dvec3);
    let [b1, b2] = [barycentric.x as f64, barycentric.y as f64];
    let weights = [1.0 - b1 - b2, b1, b2];
    let blend = |values: [DVec3; 3]| weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2];
    let size =
        weights[0].abs() * corners[0].abs() + b1.abs() * corners[1].abs() + b2.abs() * corners[2].abs();

    let winding = scaled_normal(points).normalize_or_zero();
    let shading_normal = (!mesh.normals.is_empty())
        .then(|| blend(mesh.indices[triangle as usize].map(|index| mesh.normals[index as usize].as_dvec3())))
        .filter(|normal| normal.length_squared() > 0.0);
    let flip = match shading_normal {
        Some(normal) => winding.dot(normal) < 0.0,
        None => flip_normal && mesh.normals.is_empty(),
    };

    let uvs = corner_uvs(mesh, triangle);
    let (dpdu, dpdv) = tangents(corners, uvs.map(Vec2::as_dvec2));
    LocalPoint {
        position: blend(corners),
        error: gamma(7) as f64 * size,
        geometric_normal: if flip { -winding } else { winding },
        shading_normal,
        dpdu,
        dpdv,
        uv: uv(mesh, triangle, barycentric),
    }
}

/// Partial derivatives of position with respect to the texture coordinates; zero if those span no
/// area.
fn tangents(p: [DVec3; 3], uv: [DVec2; 3]) -> (DVec3, DVec3) {
    let (along, across) = (p[0] - p[2], p[1] - p[2]);
    let (uv_along, uv_across) = (uv[0] - uv[2], uv[1] - uv[2]);
    let determinant = uv_along.perp_dot(uv_across);
    if determinant == 0.0 {
        return (DVec3::ZERO, DVec3::ZERO);
    }
    (
        (uv_across.y * along - uv_along.y * across) / determinant,
        (uv_along.x * across - uv_across.x * along) / determinant,
    )
}
