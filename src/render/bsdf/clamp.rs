//! Clamping of material parameters, which textures may set to any value.

/// Clamps to [0, `max`]; NaN becomes 0.
pub(super) fn clamp_or_zero(value: f32, max: f32) -> f32 {
    if value > 0.0 { value.min(max) } else { 0.0 }
}
