//! Bounds on the error of floating-point arithmetic (pbrt-v4, section 6.8).

use glam::Vec3;

/// Largest relative error of one rounded `f32` operation.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of a transform, or of a point on a sphere, in double precision.
pub const DOUBLE_ROUNDING: f32 = (16.0 * f64::EPSILON) as f32;

/// Bound on the relative error after `n` rounded operations (pbrt-v4, equation 6.14).
pub const fn gamma(n: u32) -> f32 {
    let accumulated = n as f32 * UNIT_ROUNDOFF;
    accumulated / (1.0 - accumulated)
}

/// Moves `position` along `normal` to the side of `w`, beyond every point within `error` of it; the
/// distance covers the rounding of this function too (pbrt-v4, section 6.8.6).
#[inline(always)]
pub fn offset_origin(position: Vec3, error: Vec3, normal: Vec3, w: Vec3) -> Vec3 {
    // γ(2) bounds the rounding of this distance and of the sum.
    let distance = normal.abs().dot(error + gamma(2) * position.abs());
    position + distance.copysign(w.dot(normal)) * normal
}
