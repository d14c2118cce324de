//! Checks of single values. `field` is only called to name an invalid one.

use std::fmt::Display;

use glam::{DAffine3, DVec3, Vec3};

use super::validation_error::{Result, ValidationError};
use crate::scene::AnimatedTransform;

/// Requires `valid`; otherwise reports `value`.
pub fn require(
    valid: bool,
    field: impl FnOnce() -> String,
    value: impl Display,
    expected: &'static str,
) -> Result {
    if valid {
        return Ok(());
    }
    Err(ValidationError::InvalidValue { field: field(), value: value.to_string(), expected })
}

/// Requires an index below `count`.
pub fn index(index: usize, count: usize, field: impl FnOnce() -> String) -> Result {
    if index < count {
        return Ok(());
    }
    Err(ValidationError::IndexOutOfRange { field: field(), index, count })
}

/// Requires a finite number above 0.
pub fn positive(value: f32, field: impl FnOnce() -> String) -> Result {
    require(value > 0.0 && value.is_finite(), field, value, "a finite number above 0")
}

/// Requires a finite number.
pub fn finite(value: f32, field: impl FnOnce() -> String) -> Result {
    require(value.is_finite(), field, value, "a finite number")
}

/// Requires finite coordinates.
pub fn finite_vector(value: Vec3, field: impl FnOnce() -> String) -> Result {
    require(value.is_finite(), field, value, "finite coordinates")
}

/// Requires finite coordinates in double precision.
pub fn finite_point(value: DVec3, field: impl FnOnce() -> String) -> Result {
    require(value.is_finite(), field, value, "finite coordinates")
}

/// Requires finite channels of at least 0.
pub fn emission(value: Vec3, field: impl FnOnce() -> String) -> Result {
    let valid = value.is_finite() && value.cmpge(Vec3::ZERO).all();
    require(valid, field, value, "finite channels of at least 0")
}

/// Requires a transform that is finite and invertible in single precision.
pub fn transform(value: &DAffine3, field: impl FnOnce() -> String) -> Result {
    let inverse = value.inverse();
    let valid = value.as_affine3a().is_finite()
        && value.matrix3.determinant().is_normal()
        && inverse.as_affine3a().is_finite();
    require(valid, field, format_args!("{value:?}"), "a finite, invertible transform")
}

/// Requires valid key transforms at rising times.
pub fn animated_transform(value: &AnimatedTransform, field: impl Fn() -> String) -> Result {
    let [start, end] = [value.start_time, value.end_time];
    let valid = start.is_finite() && end.is_finite() && start <= end;
    require(valid, &field, format_args!("from {start} to {end}"), "finite, rising key times")?;
    transform(&value.start, &field)?;
    transform(&value.at_f64(end), &field)
}
