//! From a pixel-statistics store to an image and maps: P-RPF, a file for each step of the paper,
//! and the patch-distance filter of `standard` and `draft`.
//!
//! Knows nothing of where samples come from.

mod assessment;
mod bilateral;
mod mutual_information;
mod neighbourhood;
mod outliers;
mod padded;
mod prpf;
#[cfg(test)]
mod synthetic;
mod upsampling;
mod weights;

pub use outliers::OutlierSettings;
pub use prpf::{Gain, PrpfSettings, filter, interpolation_failure};

use crate::image::Planes;

/// What a filter makes of a store.
#[derive(Clone, Debug)]
pub struct Filtered {
    /// The image: 3 planes, linear RGB, directly visible emission included.
    pub image: Planes,
    /// The image as each half of the samples alone gives it (with weights that may come from
    /// elsewhere); `image` is their mean, weighted by sample counts.
    pub halves: [Planes; 2],
    /// Where interpolation of feature weights failed: 1 at pixels computed directly, 0 at
    /// interpolated and grid pixels (averaged over passes). 1 plane; `None` where the filter ran
    /// without its grid stage.
    pub interpolation_failure: Option<Planes>,
    /// Share of non-grid pixels whose weights were interpolated.
    pub interpolation_success: Option<f32>,
    /// Squared difference of the filtered from the unfiltered image over its expected value; about
    /// 1 where the filter is right, above where it is biased. 1 plane.
    pub residual: Planes,
    /// Estimated variance of the filtered pixel, from the halves: ¼(F_A − F_B)². 3 planes.
    pub variance: Planes,
    /// Estimated squared error of the filtered pixel, mean of channels. 1 plane.
    pub error: Planes,
}
