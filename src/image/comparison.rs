//! Computes every metric of an image and its reference at once.

use super::metrics::Pair;
use super::perceptual::FlipMap;

/// The values of all metrics; [`Pair`] has their formulas.
#[derive(serde::Serialize)]
pub struct Comparison {
    pub mse: f64,
    pub relmse: f64,
    pub block_relmse: f64,
    pub psnr: f64,
    pub ssim: f64,
    pub flip: f64,
    pub mean_ratio: f64,
    /// Number of pixels that all of these exclude.
    pub excluded_pixels: usize,
    /// The map of which `flip` is the mean.
    #[serde(skip)]
    pub flip_map: FlipMap,
}

impl Comparison {
    /// Compares the images of a pair, which have 3 planes.
    pub fn new(pair: &Pair) -> Self {
        let flip_map = pair.flip();
        Self {
            mse: pair.mse(),
            relmse: pair.relmse(),
            block_relmse: pair.block_relmse(),
            psnr: pair.psnr(),
            ssim: pair.ssim(),
            flip: flip_map.mean,
            mean_ratio: pair.mean_ratio(),
            excluded_pixels: pair.excluded(),
            flip_map,
        }
    }
}
