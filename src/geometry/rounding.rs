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
/// `error` of it lies behind; every component is then rounded away from the surface.
pub fn offset_origin(position: Vec3, error: Vec3, normal: Vec3, w: Vec3) -> Vec3 {
    let distance = normal.abs().dot(error);
    let offset = if w.dot(normal) < 0.0 { -distance } else { distance } * normal;
    let away = |x: f32, towards: f32| match towards {
        up if up > 0.0 => x.next_up(),
        down if down < 0.0 => x.next_down(),
        _ => x,
    };
    let moved = position + offset;
    Vec3::new(away(moved.x, offset.x), away(moved.y, offset.y), away(moved.z, offset.z))
}
