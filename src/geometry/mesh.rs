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
    let (normal, is_exact) = single_normal(corners);
    if is_exact { normal } else { scaled_normal(corners).normalize_or_zero().as_vec3() }
}

/// The unit normal in single precision, which does not hold the square that it takes where a triangle is
/// tiny or huge: whether it does.
#[inline(always)]
pub fn single_normal([a, b, c]: [Vec3; 3]) -> (Vec3, bool) {
    let normal = (b - a).cross(c - a);
    let squared = normal.length_squared();
    (normal * squared.sqrt().recip(), (squared > 1e-30) & (squared < 1e30))
}

/// The interpolated normal of any length, whether there is one that can be used, and the geometric normal on
/// its side. A mesh without vertex normals has that of its winding, or the opposite if `flip_normal`.
#[inline(always)]
pub fn sides(winding: Vec3, blended: Option<Vec3>, flip_normal: bool) -> (Vec3, bool, Vec3) {
    let normal = blended.unwrap_or(Vec3::ZERO);
    let has_normal = normal.length_squared() > 0.0;
    let flip = if has_normal { winding.dot(normal) < 0.0 } else { flip_normal & blended.is_none() };
    (normal, has_normal, if flip { -winding } else { winding })
}

/// Weights of the corners.
#[inline(always)]
pub fn weights(barycentric: Vec2) -> [f32; 3] {
    [1.0 - barycentric.x - barycentric.y, barycentric.x, barycentric.y]
}

#[inline(always)]
pub fn blend(weights: [f32; 3], values: [Vec3; 3]) -> Vec3 {
    weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2]
}

/// Bound on the error of a point of a triangle. pbrt weighs the corners; this is simpler, and hardly ever
/// larger by much.
#[inline(always)]
pub fn position_error(corners: [Vec3; 3]) -> Vec3 {
    gamma(8) * corners[0].abs().max(corners[1].abs()).max(corners[2].abs())
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
    let weights = weights(barycentric);
    let blended = corner_normals(mesh, triangle).map(|normals| blend(weights, normals));
    let (normal, has_normal, geometric_normal) = sides(unit_normal(corners), blended, flip_normal);

    let parametrisation = detail.then(|| {
        let uvs = corner_uvs(mesh, triangle);
        let (dpdu, dpdv) = tangents(corners, uvs);
        Parametrisation { uv: weights[0] * uvs[0] + weights[1] * uvs[1] + weights[2] * uvs[2], dpdu, dpdv }
    });
    LocalPoint {
        position: blend(weights, corners).as_dvec3(),
        error: position_error(corners),
        geometric_normal,
        shading_normal: has_normal.then_some(normal),
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
