//! The surface of a triangle mesh, with pbrt-v4's conventions (section 6.5.3).

use glam::{DVec3, Vec2, Vec3};

use super::local::{Detail, LocalPoint, Parametrisation};
use super::rounding::gamma;
use crate::scene::TriangleMesh;

/// Texture coordinates of the corners of a triangle without any.
const DEFAULT_UVS: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::ONE];

/// Corners of a triangle.
#[inline]
pub fn corners(mesh: &TriangleMesh, triangle: u32) -> [Vec3; 3] {
    mesh.indices[triangle as usize].map(|index| mesh.positions[index as usize])
}

/// Texture coordinates at a point of a triangle.
pub fn uv(mesh: &TriangleMesh, triangle: u32, barycentric: Vec2) -> Vec2 {
    let [a, b, c] = corner_uvs(mesh, triangle);
    (1.0 - barycentric.x - barycentric.y) * a + barycentric.x * b + barycentric.y * c
}

/// Normals at the corners of a triangle, if the mesh has any.
#[inline]
pub fn corner_normals(mesh: &TriangleMesh, triangle: u32) -> Option<[Vec3; 3]> {
    (!mesh.normals.is_empty())
        .then(|| mesh.indices[triangle as usize].map(|index| mesh.normals[index as usize]))
}

#[inline]
pub fn corner_uvs(mesh: &TriangleMesh, triangle: u32) -> [Vec2; 3] {
    if mesh.uvs.is_empty() {
        DEFAULT_UVS
    } else {
        mesh.indices[triangle as usize].map(|index| mesh.uvs[index as usize])
    }
}

/// Twice the area times the unit normal; exact enough in double precision for any sliver.
#[inline]
pub fn scaled_normal(corners: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a)
}

/// The direction of [`scaled_normal`].
#[inline]
fn unit_normal(corners: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let squared = normal.length_squared();
    // Of triangles that are tiny or huge the square does not fit single precision.
    if squared > 1e-30 && squared < 1e30 {
        normal * squared.sqrt().recip()
    } else {
        scaled_normal(corners).normalize_or_zero().as_vec3()
    }
}

/// The surface at a point of a triangle. A mesh with vertex normals takes their side; another's
/// side is that of its winding, or the opposite if `flip_normal`.
#[inline]
pub fn local_point(
    mesh: &TriangleMesh,
    triangle: u32,
    barycentric: Vec2,
    flip_normal: bool,
    detail: Detail,
) -> LocalPoint {
    let corners = corners(mesh, triangle);
    let weights = [1.0 - barycentric.x - barycentric.y, barycentric.x, barycentric.y];
    let blend = |values: [Vec3; 3]| weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2];
    // pbrt weighs the corners; the bound is simpler, and hardly ever larger by much.
    let size = corners[0].abs().max(corners[1].abs()).max(corners[2].abs());
    let winding = unit_normal(corners);
    let shading_normal =
        corner_normals(mesh, triangle).map(blend).filter(|normal| normal.length_squared() > 0.0);
    let flip = match shading_normal {
        Some(normal) => winding.dot(normal) < 0.0,
        None => flip_normal && mesh.normals.is_empty(),
    };

    let parametrisation = detail.then(|| {
        let uvs = corner_uvs(mesh, triangle);
        let (dpdu, dpdv) = tangents(corners, uvs);
        Parametrisation { uv: weights[0] * uvs[0] + weights[1] * uvs[1] + weights[2] * uvs[2], dpdu, dpdv }
    });
    LocalPoint {
        position: blend(corners).as_dvec3(),
        error: gamma(8) * size,
        geometric_normal: if flip { -winding } else { winding },
        shading_normal,
        parametrisation,
    }
}

/// Partial derivatives of position with respect to the texture coordinates; zero if those span no
/// area.
#[inline]
fn tangents(p: [Vec3; 3], uv: [Vec2; 3]) -> (Vec3, Vec3) {
    let (along, across) = (p[0] - p[2], p[1] - p[2]);
    let (uv_along, uv_across) = (uv[0] - uv[2], uv[1] - uv[2]);
    let determinant = uv_along.perp_dot(uv_across);
    if determinant == 0.0 {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let inverse = determinant.recip();
    (
        (uv_across.y * along - uv_along.y * across) * inverse,
        (uv_along.x * across - uv_across.x * along) * inverse,
    )
}
