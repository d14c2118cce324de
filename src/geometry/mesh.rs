//! Surface interactions on triangle meshes, with pbrt-v4's conventions (section 6.5.3).

use glam::{DVec3, Vec2, Vec3};

use super::local_interaction::{Detail, LocalInteraction, Parametrisation};
use super::rounding::gamma;
use crate::scene::{MeshTangents, TriangleMesh};

/// Texture coordinates of the corners of a triangle whose mesh has none.
const DEFAULT_UVS: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::ONE];

/// Positions of a triangle's corners.
#[inline]
pub fn corners(mesh: &TriangleMesh, triangle: u32) -> [Vec3; 3] {
    mesh.indices[triangle as usize].map(|index| mesh.positions[index as usize])
}

/// Texture coordinates at a point of a triangle.
pub fn uv(mesh: &TriangleMesh, triangle: u32, barycentric: Vec2) -> Vec2 {
    let [a, b, c] = corner_uvs(mesh, triangle);
    (1.0 - barycentric.x - barycentric.y) * a + barycentric.x * b + barycentric.y * c
}

/// Normals at a triangle's corners, if the mesh has normals.
#[inline]
pub fn corner_normals(mesh: &TriangleMesh, triangle: u32) -> Option<[Vec3; 3]> {
    (!mesh.normals.is_empty())
        .then(|| mesh.indices[triangle as usize].map(|index| mesh.normals[index as usize]))
}

/// Texture coordinates at a triangle's corners.
#[inline]
pub fn corner_uvs(mesh: &TriangleMesh, triangle: u32) -> [Vec2; 3] {
    if mesh.uvs.is_empty() {
        DEFAULT_UVS
    } else {
        mesh.indices[triangle as usize].map(|index| mesh.uvs[index as usize])
    }
}

/// Twice the area times the unit normal, in double precision, which suffices for any sliver.
#[inline]
pub fn scaled_normal(corners: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a)
}

/// The normalised [`scaled_normal`].
#[inline]
fn unit_normal(corners: [Vec3; 3]) -> Vec3 {
    let (normal, is_accurate) = fast_unit_normal(corners);
    if is_accurate { normal } else { scaled_normal(corners).normalize_or_zero().as_vec3() }
}

/// The unit normal in single precision, and whether it is accurate: the terms of the cross product cancel for slivers, and its squared
/// length overflows or underflows for huge or tiny triangles.
#[inline(always)]
pub fn fast_unit_normal([a, b, c]: [Vec3; 3]) -> (Vec3, bool) {
    /// Square of the smallest sine of the angle at the first corner.
    const LEAST_SQUARED_SINE: f32 = 1e-6;
    let (to_b, to_c) = (b - a, c - a);
    let normal = to_b.cross(to_c);
    let squared = normal.length_squared();
    let is_sliver = squared < LEAST_SQUARED_SINE * to_b.length_squared() * to_c.length_squared();
    (normal * squared.sqrt().recip(), !is_sliver & (squared > 1e-30) & (squared < 1e30))
}

/// Orients the geometric normal. Takes the unit normal of the winding and the interpolated normal if
/// the mesh has normals; returns the interpolated normal, whether it is usable (not zero), and the
/// geometric normal on its side. A mesh without normals has the side of its winding, or the opposite
/// if `flip_normal`.
#[inline(always)]
pub fn oriented_normals(winding: Vec3, interpolated: Option<Vec3>, flip_normal: bool) -> (Vec3, bool, Vec3) {
    let normal = interpolated.unwrap_or(Vec3::ZERO);
    let has_normal = normal.length_squared() > 0.0;
    let flip = if has_normal { winding.dot(normal) < 0.0 } else { flip_normal & interpolated.is_none() };
    (normal, has_normal, if flip { -winding } else { winding })
}

/// Barycentric coordinates of all three corners from those of corners 1 and 2.
#[inline(always)]
pub fn weights(barycentric: Vec2) -> [f32; 3] {
    [1.0 - barycentric.x - barycentric.y, barycentric.x, barycentric.y]
}

/// Interpolates values at the corners.
#[inline(always)]
pub fn interpolate(weights: [f32; 3], values: [Vec3; 3]) -> Vec3 {
    weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2]
}

/// Bound on the error of an interpolated position, per axis. pbrt-v4 (section 6.8.5) weights the
/// corners' magnitudes; their maximum is cheaper and seldom much larger.
#[inline(always)]
pub fn position_error(corners: [Vec3; 3]) -> Vec3 {
    gamma(8) * corners[0].abs().max(corners[1].abs()).max(corners[2].abs())
}

/// The surface at a point of a triangle, in the object's space.
#[inline]
pub fn interaction(
    mesh: &TriangleMesh,
    triangle: u32,
    barycentric: Vec2,
    flip_normal: bool,
    detail: Detail,
) -> LocalInteraction {
    let corners = corners(mesh, triangle);
    let weights = weights(barycentric);
    let interpolated = corner_normals(mesh, triangle).map(|normals| interpolate(weights, normals));
    let (normal, has_normal, geometric_normal) =
        oriented_normals(unit_normal(corners), interpolated, flip_normal);

    let parametrisation = detail.then(|| {
        let uvs = corner_uvs(mesh, triangle);
        let parametric = tangents(corners, uvs);
        let (dpdu, dpdv) =
            if has_normal { shading_tangents(mesh.tangents, normal, parametric) } else { parametric };
        Parametrisation { uv: weights[0] * uvs[0] + weights[1] * uvs[1] + weights[2] * uvs[2], dpdu, dpdv }
    });
    LocalInteraction {
        position: interpolate(weights, corners).as_dvec3(),
        error: position_error(corners),
        geometric_normal,
        shading_normal: has_normal.then_some(normal),
        parametrisation,
    }
}

/// The tangents of a mesh with normals, from the interpolated normal of any length.
#[inline]
fn shading_tangents(kind: MeshTangents, normal: Vec3, (dpdu, dpdv): (Vec3, Vec3)) -> (Vec3, Vec3) {
    if kind == MeshTangents::Parametric {
        return (dpdu, dpdv);
    }
    let normal = normal.normalize();
    let across = normal.cross(dpdu);
    if kind == MeshTangents::Perpendicular {
        return (dpdu, across);
    }
    let across = across.normalize_or_zero();
    (normal.cross(across), -across)
}

/// ∂p/∂u and ∂p/∂v; zero if the texture coordinates span no area.
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
