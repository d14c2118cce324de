//! Bounds on floating-point rounding, after pbrt-v4, section 6.8.

use glam::Vec3;

/// Largest relative error of one rounded `f32` operation.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error after `n` rounded operations (pbrt-v4, equation 6.14).
pub const fn gamma(n: u32) -> f32 {
    let accumulated = n as f32 * UNIT_ROUNDOFF;
    accumulated / (1.0 - accumulated)
}

/// `position` moved along `normal`, to the side of `w`, so far that the true surface within
/// `error` of it lies behind, whatever the sum's own rounding does.
#[inline(always)]
pub fn offset_origin(position: Vec3, error: Vec3, normal: Vec3, w: Vec3) -> Vec3 {
    // γ(2): the rounding of the result, and of what is computed here.
    let distance = normal.abs().dot(error + gamma(2) * position.abs());
    position + distance.copysign(w.dot(normal)) * normal
}
