//! Limits the samples, the time and the error of a render.

/// Limits of a render; the first one reached ends it. `None` is off.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Budget {
    /// Samples per pixel, on average.
    pub spp: Option<u32>,
    /// Seconds from the program's start until the image is written.
    pub seconds: Option<f64>,
    /// Estimated relMSE of the image.
    pub target_error: Option<f64>,
}
