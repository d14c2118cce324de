//! Movements of the camera that the page asks for.

use serde::Deserialize;

/// Largest angle of one move, in radians.
const LARGEST_TURN: f32 = std::f32::consts::TAU;
/// Largest pan of one move, in image heights, and largest dolly, as a natural logarithm.
const LARGEST_SHIFT: f32 = 4.0;
/// Largest radius of the lens and largest focal distance, in scene units.
const LARGEST_LENGTH: f32 = 1e9;

/// A movement of the camera; absent parts stay.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraMove {
    /// Rotation around the pivot: to the right and up, in radians.
    pub orbit: Option<[f32; 2]>,
    /// Shift of the image to the right and down, in image heights.
    pub pan: Option<[f32; 2]>,
    /// Approach to the pivot: natural logarithm of the factor that divides the distance.
    pub dolly: Option<f32>,
    /// Radius of the lens, in scene units.
    pub aperture: Option<f32>,
    /// Focal distance, in scene units.
    pub focus: Option<f32>,
    /// Number of the bookmark to go to first.
    pub bookmark: Option<usize>,
    /// Pixel whose visible point comes into focus.
    pub focus_at: Option<[u32; 2]>,
    /// Whether the scene's own camera returns first.
    #[serde(default)]
    pub reset: bool,
}

impl CameraMove {
    /// Checks that all parts are in range.
    ///
    /// # Errors
    /// One line that names the part and its range.
    pub fn check(&self) -> Result<(), String> {
        let signed = |name: &str, values: &[f32], limit: f32| {
            let is_within = values.iter().all(|v| v.abs() <= limit);
            if is_within { Ok(()) } else { Err(format!("`{name}` has to be within ±{limit}")) }
        };
        let length = |name: &str, value: Option<f32>| match value {
            Some(v) if !(0.0..=LARGEST_LENGTH).contains(&v) => {
                Err(format!("`{name}` has to be from 0 to {LARGEST_LENGTH:e}"))
            }
            _ => Ok(()),
        };
        signed("orbit", &self.orbit.unwrap_or_default(), LARGEST_TURN)?;
        signed("pan", &self.pan.unwrap_or_default(), LARGEST_SHIFT)?;
        signed("dolly", &[self.dolly.unwrap_or_default()], LARGEST_SHIFT)?;
        length("aperture", self.aperture)?;
        length("focus", self.focus)
    }
}
