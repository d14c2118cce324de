//! Directions in the local frame of a surface, with z along the shading normal.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use crate::render::disk::concentric_disk;

/// Rounding in the change of frame makes the side of directions with smaller cosines uncertain; nothing scatters
/// from or to them.
const HORIZON_COS: f32 = 1e-6;

/// Whether a direction is in the surface, up to rounding, or NaN.
#[inline(always)]
pub(super) fn on_horizon(w: Vec3) -> bool {
    w.z.is_nan() || w.z.abs() <= HORIZON_COS
}

/// Whether two directions are on the same side of the surface.
#[inline(always)]
pub(super) fn same_hemisphere(a: Vec3, b: Vec3) -> bool {
    a.z * b.z > 0.0
}

/// The direction, mirrored at the surface's plane if necessary to be on the side of `reference`.
#[inline(always)]
pub(super) fn to_hemisphere_of(w: Vec3, reference: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, w.z.abs().copysign(reference.z))
}

/// Perfect specular reflection.
pub(super) fn reflect(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}

/// Density per solid angle of [`sample_cosine_hemisphere`] on either side.
#[inline(always)]
pub(super) fn cosine_hemisphere_pdf(wi: Vec3) -> f32 {
    FRAC_1_PI * wi.z.abs()
}

/// Maps `u` in [0, 1)² to a cosine-distributed direction of the upper hemisphere (Malley's method).
#[inline(always)]
pub(super) fn sample_cosine_hemisphere(u: Vec2) -> Vec3 {
    let p = concentric_disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}
