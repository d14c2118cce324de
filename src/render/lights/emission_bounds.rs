//! The bounds on a light's emission from which the light sampler computes the light's probability.

use glam::Vec3;

use super::light_bounds::LightBounds;

/// Bounds on the emission of one light.
#[derive(Clone, Copy, Debug)]
pub enum EmissionBounds {
    /// A light at a finite distance.
    Finite(LightBounds),
    /// A light at infinity. With a `direction` (unit, towards the light) the light is parallel, and
    /// `irradiance` is that of a surface facing it; without one, `irradiance` is the mean over all surface
    /// orientations.
    Infinite { direction: Option<Vec3>, irradiance: f32 },
}

impl EmissionBounds {
    /// `None` if the emission is zero or not finite: such a light is never sampled.
    pub fn non_zero(self) -> Option<Self> {
        let (amount, is_finite) = match &self {
            Self::Finite(bounds) => {
                (bounds.intensity, bounds.centre.is_finite() && bounds.radius.is_finite())
            }
            Self::Infinite { irradiance, .. } => (*irradiance, true),
        };
        (amount > 0.0 && amount.is_finite() && is_finite).then_some(self)
    }
}

/// Mean of the three channels, by which lights are compared.
pub fn average(rgb: Vec3) -> f32 {
    rgb.element_sum() / 3.0
}
