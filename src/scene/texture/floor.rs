//! Rounding down without the function call that `f32::floor` is where the target has no instruction for it.

use glam::Vec3;

/// From this magnitude on every number is an integer.
const ALL_INTEGERS: f32 = (1 << 23) as f32;

/// As [`f32::floor`].
#[inline]
pub fn floor(x: f32) -> f32 {
    let truncated = x as i32 as f32;
    let floor = if truncated > x { truncated - 1.0 } else { truncated };
    if x.abs() < ALL_INTEGERS { floor } else { x }
}

/// As [`Vec3::floor`].
#[inline]
pub fn floor3(v: Vec3) -> Vec3 {
    v.map(floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_largest_integer_below() {
        let large = [8_388_607.5, 8_388_608.0, 3e9, 1e30, f32::INFINITY];
        let small = [0.0, 0.3, 0.999_999_94, 1.0, 1.5, 256.25];
        for x in small.into_iter().chain(large) {
            assert_eq!([floor(x), floor(-x)], [x.floor(), (-x).floor()], "{x}");
        }
        assert!(floor(f32::NAN).is_nan() && floor3(Vec3::NAN).is_nan());
    }
}
