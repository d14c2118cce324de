//! The estimate of an image's relMSE, from the two halves of the samples that it was made of.
//!
//! The estimate combines two means over the image. Each has a standard error, from the spread over tiles, and a deviation that
//! was measured; their mean, weighted by both in logarithms, is the estimate.
//!
//! * The error of a denoiser whose weights follow the samples is estimated by the images that it makes of each half alone (see
//!   `half_images`), unless the pass leaves them out to save time.
//! * That of others is estimated by two maps of the filter pass. The risk is unbiased as far as the filter is linear, and noisy: one rare bright sample
//!   may dominate its mean. The variance between the halves is far less noisy, but blind to bias. The denoiser states their
//!   deviations ([`Reliability`](crate::filter::Reliability)). Both are relative to the blurred image: relative to noisy
//!   pixels they would be up to five times too large. The pixel itself is left out of the blur, since a firefly would hide its
//!   own error.
//!
//! The estimate cannot include light that no sample found.

mod half_images;
mod tile_means;

use crate::filter::{FilterResult, blur, risk_of_means};
use crate::image::Planes;
use crate::image::metrics::RELMSE_EPSILON;
use crate::stats::{Part, Store};
pub use half_images::HalfImages;
pub use tile_means::TILE;
use tile_means::{Mean, TileMeans};

/// Standard deviation of the blur of the image that maps are relative to, in pixels.
const LEVEL_SIGMA: f32 = 1.5;

/// Deviations on either side that 95 % of a normal distribution lie within.
const DEVIATIONS: f64 = 1.96;

/// An image's estimated relMSE, in all and by tile.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// Estimated relMSE of the image.
    pub value: f64,
    /// Standard deviation of the estimate's logarithm.
    pub deviation: f64,
    /// Estimated relMSE of the samples' means, unfiltered.
    pub unfiltered: f64,
    /// Samples that the image was made of.
    pub samples: u64,
    /// relMSE by tile of 16×16 pixels, 1 plane.
    pub tiles: Planes,
}

/// Value and interval of an estimate, for the page and the progress bar.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct EstimateSummary {
    /// relMSE of the image.
    pub error: f64,
    /// Its 95 % interval.
    pub low: f64,
    pub high: f64,
    /// relMSE of the unfiltered image.
    pub unfiltered: f64,
    /// Samples that the image was made of.
    pub samples: u64,
}

impl ErrorEstimate {
    /// Estimates the error of the image of a filter pass over `store`, by the images of its halves if there are some. `None` if
    /// fewer than half of the pixels have samples in both halves, or if the estimate would not be finite.
    pub fn new(result: &FilterResult, store: &Store, halves: Option<&HalfImages>) -> Option<Self> {
        // Average risk and variance over tiles
        let counts = [0, 1].map(|h| store.counts(Part::Half(h)));
        let is_known = |i: usize| counts.iter().all(|counts| counts[i] > 0);
        let level = level(&result.image);
        let noisy = [0, 1].map(|half| store.means(Part::Half(half), store.layout().radiance()));
        let maps = [&result.risk, &result.variance, &risk_of_means(store, &noisy)];
        let relative = maps.map(|map| relative(map, &level));
        let size = [store.width(), store.height()];
        let means_over_tiles = |map: &Planes| TileMeans::new(size, |i| map.data()[i].into(), is_known);
        let [risk_tiles, variance_tiles, unfiltered_tiles] = relative.each_ref().map(means_over_tiles);
        if 2 * risk_tiles.pixels() < store.pixels() {
            return None;
        }
        let (risk, variance) = (risk_tiles.mean(), variance_tiles.mean());

        // Average two estimates in logarithms
        let (value, deviation) = if variance.value > 0.0 {
            let by_halves = halves.and_then(|halves| halves.estimates(&result.image, &relative[1], variance));
            average(by_halves.unwrap_or_else(|| {
                let reliability = result.reliability;
                let spp = store.spp();
                [
                    (risk.times(reliability.risk_factor), reliability.risk_deviation),
                    (variance.times(reliability.variance_factor_at(spp)), reliability.variance_deviation),
                ]
            }))
        } else {
            // The halves agree: there is no noise
            (risk.value.max(0.0), 0.0)
        };
        if !value.is_finite() {
            return None;
        }
        Some(Self {
            value,
            deviation,
            unfiltered: unfiltered_tiles.mean().value.min(f64::MAX),
            samples: store.samples(),
            tiles: tile_errors(&risk_tiles, &variance_tiles, value),
        })
    }

    /// Returns the estimate in short.
    pub fn summary(&self) -> EstimateSummary {
        let [low, high] = self.interval();
        let Self { value: error, unfiltered, samples, .. } = *self;
        EstimateSummary { error, low, high, unfiltered, samples }
    }

    /// Returns the interval that holds the error with 95 % confidence, as far as the deviation can tell.
    pub fn interval(&self) -> [f64; 2] {
        [-DEVIATIONS, DEVIATIONS].map(|deviations| self.value * (deviations * self.deviation).exp())
    }

    /// Returns the tiles' estimates at every pixel of an image of the size that they were made for: 1 plane.
    pub fn to_pixels(&self, width: usize, height: usize) -> Planes {
        let mut pixels = Planes::new(width, height, 1);
        for (y, row) in pixels.data_mut().chunks_mut(width.max(1)).enumerate() {
            for (x, value) in row.iter_mut().enumerate() {
                *value = self.tiles.at(0, x / TILE, y / TILE);
            }
        }
        pixels
    }
}

/// Returns the blurred image, at each pixel without the pixel itself: 3 planes.
fn level(image: &Planes) -> Planes {
    let mut level = image.clone();
    for plane in level.planes_mut() {
        plane.copy_from_slice(&blur::gaussian_of_others(image.width(), image.height(), plane, LEVEL_SIGMA));
    }
    level
}

/// Returns a squared error relative to the squared level, mean of the channels: 1 plane.
fn relative(map: &Planes, level: &Planes) -> Planes {
    let mut relative = Planes::new(map.width(), map.height(), 1);
    let of_channel =
        |i: usize, c: usize| map.plane(c)[i] / (level.plane(c)[i].powi(2) + RELMSE_EPSILON as f32);
    for (i, value) in relative.data_mut().iter_mut().enumerate() {
        *value = (0..3).map(|c| of_channel(i, c)).sum::<f32>() / 3.0;
    }
    relative
}

/// Averages two estimates in logarithms, weighted by the inverse squares of their deviations. Each has the deviation of its
/// logarithm beside its noise. Returns the mean and the deviation of its logarithm.
fn average(estimates: [(Mean, f64); 2]) -> (f64, f64) {
    let logarithms = estimates.map(|(mean, deviation)| mean.logarithm(deviation));
    let weights = logarithms.map(|(_, deviation)| deviation.powi(-2));
    let sum = weights[0] + weights[1];
    let mean = (weights[0] * logarithms[0].0 + weights[1] * logarithms[1].0) / sum;
    (mean.exp(), sum.powf(-0.5))
}

/// Returns the errors of the tiles: the variance, or the risk where it is larger, in a scale in which their mean is `value`.
fn tile_errors(risk: &TileMeans, variance: &TileMeans, value: f64) -> Planes {
    let errors: Vec<f64> = (0..risk.len()).map(|i| variance.tile_mean(i).max(risk.tile_mean(i))).collect();
    let mean = errors.iter().enumerate().map(|(i, error)| risk.pixels_of(i) * error).sum::<f64>()
        / risk.pixels().max(1) as f64;
    let scale = if mean > 0.0 { value / mean } else { 0.0 };
    let mut tiles = Planes::new(risk.columns, risk.len() / risk.columns.max(1), 1);
    for (i, (tile, error)) in tiles.data_mut().iter_mut().zip(&errors).enumerate() {
        // A tile without known pixels has the image's error
        *tile = if risk.pixels_of(i) > 0.0 { (scale * error) as f32 } else { value as f32 };
    }
    tiles
}

#[cfg(test)]
mod tests;
