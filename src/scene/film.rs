//! The film: resolution, the part of it that is rendered, the pixel filter.

use glam::Mat3;

/// The image plane and its sampling.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Resolution of the whole image, in pixels.
    pub width: usize,
    pub height: usize,
    /// The part that is rendered: x0, x1, y0, y1 in pixels, half open (pbrt's order).
    pub pixel_bounds: [usize; 4],
    pub filter: PixelFilter,
    /// Name of the output file in the scene, if any.
    pub filename: Option<String>,
    /// Factor from radiance to pixel value (pbrt-v4's imaging ratio).
    pub scale: f32,
    /// Matrix that the linear RGB radiance of a sample is multiplied by, if any (pbrt-v4's white balance). Channels
    /// below 0 become 0.
    pub white_balance: Option<Mat3>,
}

/// Largest width or height of a film in pixels, the limit of the live preview's frames.
pub const MAX_SIDE: u32 = u16::MAX as u32;
/// Largest number of pixels of a film.
pub const MAX_PIXELS: u64 = 1 << 27;

/// Reconstruction filter, importance sampled: each sample contributes to one pixel. Radii are in
/// pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PixelFilter {
    Box {
        radius: [f32; 2],
    },
    Triangle {
        radius: [f32; 2],
    },
    /// exp(-x²/2σ²) minus its value at the radius.
    Gaussian {
        radius: [f32; 2],
        sigma: f32,
    },
    /// Mitchell and Netravali 1988.
    Mitchell {
        radius: [f32; 2],
        b: f32,
        c: f32,
    },
    /// sin(x)/x windowed by sin(x/τ)/(x/τ).
    Sinc {
        radius: [f32; 2],
        tau: f32,
    },
}
