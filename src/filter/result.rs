//! The result of a filter pass, as maps, page, state and files use it.

use super::common::error_maps::ErrorMaps;
use super::denoiser_name::DenoiserName;
use crate::image::Planes;
use crate::stats::{Part, Store};

/// An image and its maps. All planes have the store's size.
#[derive(Clone, Debug)]
pub struct FilterResult {
    /// The denoiser that made it.
    pub made_by: DenoiserName,
    /// The image: 3 planes, linear RGB, directly visible emission included.
    pub image: Planes,
    /// The image as each half of the samples alone gives it (with weights that may come from the other half); `image`
    /// is their mean, weighted by sample counts.
    pub halves: [Planes; 2],
    /// Estimated variance of the pixel: of a filtered image ¼(F_A − F_B)² from its halves, of an unfiltered one s²/n.
    /// 3 planes, squared radiance.
    pub variance: Planes,
    /// Estimated squared error of the filtered pixel, mean of channels. 1 plane, squared radiance.
    pub error: Planes,
    /// Squared difference of the filtered from the unfiltered image over its expected value: about 1 where the filter
    /// is unbiased, above where it is biased. 1 plane.
    pub residual: Planes,
    /// Unbiased estimate of the squared error, far too noisy pixel by pixel; 0 where a half has no samples. 3 planes,
    /// squared radiance.
    pub risk: Planes,
    /// How the means of variance and risk over the image relate to its true error.
    pub reliability: Reliability,
    /// How interpolation of feature weights went; `None` from a denoiser that does not interpolate.
    pub interpolation: Option<Interpolation>,
    /// Why the denoiser failed, if this is an unfiltered image in place of its own.
    pub failure: Option<String>,
}

impl FilterResult {
    /// Returns the result of a filter whose weights depend on the samples that they filter: its image and what it makes of each half
    /// (3 planes each), with the maps that follow from both and from the samples.
    pub fn self_filtered(
        made_by: DenoiserName,
        store: &Store,
        image: Planes,
        halves: [Planes; 2],
        reliability: Reliability,
    ) -> Self {
        let radiance = store.layout().radiance();
        let noisy_halves = [0, 1].map(|half| store.means(Part::Half(half), radiance.clone()));
        let counts = [0, 1].map(|half| store.counts(Part::Half(half)));
        let maps = ErrorMaps::self_filtered(
            &image,
            halves.each_ref(),
            &store.means(Part::Whole, radiance.clone()),
            &store.variances(Part::Whole, radiance),
            noisy_halves.each_ref(),
            counts.each_ref().map(Vec::as_slice),
        );
        Self::with_maps(made_by, image, halves, maps, reliability)
    }

    /// Returns the result of a filter that does not interpolate and has not failed.
    pub(super) fn with_maps(
        made_by: DenoiserName,
        image: Planes,
        halves: [Planes; 2],
        maps: ErrorMaps,
        reliability: Reliability,
    ) -> Self {
        let ErrorMaps { variance, residual, risk, error } = maps;
        Self {
            made_by,
            image,
            halves,
            variance,
            error,
            residual,
            risk,
            reliability,
            interpolation: None,
            failure: None,
        }
    }
}

/// Calibration of two estimators of an image's relMSE, the mean relative risk and the mean relative variance
/// ¼(F_A − F_B)²: each times its factor is the relMSE, up to a log-normal error. Measured at 8 to 128 samples per pixel on our
/// five scenes, that of the learned filter at 2 to 128 on six generated ones, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reliability {
    pub risk_factor: f64,
    pub risk_deviation: f64,
    pub variance_factor: f64,
    /// The variance's factor falls with the samples per pixel n: it is `variance_factor` · n^−`variance_exponent`, at least 1.
    pub variance_exponent: f64,
    pub variance_deviation: f64,
}

impl Reliability {
    /// Of filters that take the weights of each half from the other.
    pub const CROSS_FILTERED: Self = Self {
        risk_factor: 1.2,
        risk_deviation: 0.22,
        variance_factor: 2.3,
        variance_exponent: 0.0,
        variance_deviation: 0.45,
    };
    /// Of filters whose weights depend on the samples that they filter.
    pub const SELF_FILTERED: Self = Self {
        risk_factor: 1.5,
        risk_deviation: 0.5,
        variance_factor: 4.0,
        variance_exponent: 0.0,
        variance_deviation: 0.9,
    };
    /// Of the learned filter, which trades noise for bias: of few samples most of its error is bias.
    pub const LEARNED: Self = Self {
        risk_factor: 2.1,
        risk_deviation: 0.64,
        variance_factor: 6.3,
        variance_exponent: 0.36,
        variance_deviation: 0.65,
    };
    /// Of the means of the samples, whose risk is their variance.
    pub const UNFILTERED: Self = Self {
        risk_factor: 1.0,
        risk_deviation: 0.1,
        variance_factor: 1.0,
        variance_exponent: 0.0,
        variance_deviation: 0.5,
    };
}

impl Reliability {
    /// Returns the factor of the variance of an image of `spp` samples per pixel.
    pub fn variance_factor_at(&self, spp: f64) -> f64 {
        (self.variance_factor * spp.max(1.0).powf(-self.variance_exponent)).max(1.0)
    }
}

/// Where interpolation of feature weights between the nodes of the sparse grid failed (P-RPF, section 4.3).
#[derive(Clone, Debug, PartialEq)]
pub struct Interpolation {
    /// 1 at pixels whose weights had to be computed directly, 0 at interpolated pixels and at nodes; averaged over
    /// passes. 1 plane.
    pub failure: Planes,
    /// Fraction of the pixels between nodes whose weights were interpolated, in [0, 1].
    pub success: f32,
}
