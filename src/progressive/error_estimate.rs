//! The estimate of an image's relMSE, from the two halves of the samples that it was made of.
//!
//! The estimate combines two maps of a filter pass. The risk is unbiased as far as the filter is linear, and noisy: one
//! rare bright sample may dominate its mean. The variance between the halves is far less noisy, but blind to bias. Each has a standard error, from the spread over tiles, and a deviation that the denoiser states
//! ([`Reliability`](crate::filter::Reliability)); their mean, weighted by both in logarithms, is the estimate. Errors are
//! relative to the blurred image: relative to its noisy pixels they would be up to five times too large. The pixel itself is
//! left out of the blur, since a firefly would hide its own error.
//!
//! The estimate cannot include light that no sample found.

use crate::filter::{FilterResult, blur};
use crate::image::Planes;
use crate::image::metrics::RELMSE_EPSILON;
use crate::stats::{Part, Store};

/// Side of the tiles, in pixels.
pub const TILE: usize = 16;

/// Standard deviation of the blur of the image that errors are relative to, in pixels.
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
    /// Samples that the image was made of.
    pub samples: u64,
}

impl ErrorEstimate {
    /// Estimates the error of the image of a filter pass over `store`. `None` if fewer than half of the pixels have samples
    /// in both halves, or if the estimate would not be finite.
    pub fn new(result: &FilterResult, store: &Store) -> Option<Self> {
        // Average risk and variance over tiles
        let counts = [0, 1].map(|h| store.counts(Part::Half(h)));
        let is_known = |i: usize| counts.iter().all(|counts| counts[i] > 0);
        let level = level(&result.image);
        let tiles = [&result.risk, &result.variance].map(|map| Tiles::new(map, &level, is_known));
        if 2 * tiles[0].pixels() < store.pixels() {
            return None;
        }
        let [risk, variance] = tiles.each_ref().map(Tiles::mean);

        // Average both estimates in logarithms
        let (value, deviation) = if variance.value > 0.0 {
            let reliability = result.reliability;
            let risk = risk.logarithm(reliability.risk_factor, reliability.risk_deviation);
            let spp = store.samples() as f64 / store.pixels() as f64;
            let variance =
                variance.logarithm(reliability.variance_factor_at(spp), reliability.variance_deviation);
            let weights = [risk, variance].map(|(_, deviation)| deviation.powi(-2));
            let sum = weights[0] + weights[1];
            (((weights[0] * risk.0 + weights[1] * variance.0) / sum).exp(), sum.powf(-0.5))
        } else {
            // The halves agree: there is no noise
            (risk.value.max(0.0), 0.0)
        };
        if !value.is_finite() {
            return None;
        }
        let tiles = tile_errors(&tiles, value);
        Some(Self { value, deviation, samples: store.samples(), tiles })
    }

    /// Returns the estimate in short.
    pub fn summary(&self) -> EstimateSummary {
        let [low, high] = self.interval();
        EstimateSummary { error: self.value, low, high, samples: self.samples }
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

/// Sums of a relative error over tiles.
struct Tiles {
    columns: usize,
    sums: Vec<f64>,
    counts: Vec<u32>,
}

/// A mean over an image, and its standard error.
struct Mean {
    value: f64,
    standard_error: f64,
}

impl Tiles {
    /// `map`: a squared error, 3 planes; `level`: the radiance that it is relative to.
    fn new(map: &Planes, level: &Planes, is_known: impl Fn(usize) -> bool) -> Self {
        let (width, height) = (map.width(), map.height());
        let columns = width.div_ceil(TILE);
        let tiles = columns * height.div_ceil(TILE);
        let (mut sums, mut counts) = (vec![0.0; tiles], vec![0; tiles]);
        for i in (0..width * height).filter(|&i| is_known(i)) {
            let relative = |c: usize| map.plane(c)[i] / (level.plane(c)[i].powi(2) + RELMSE_EPSILON as f32);
            let tile = i / width / TILE * columns + i % width / TILE;
            sums[tile] += (0..3).map(|c| f64::from(relative(c))).sum::<f64>() / 3.0;
            counts[tile] += 1;
        }
        Self { columns, sums, counts }
    }

    fn pixels(&self) -> usize {
        self.counts.iter().map(|&n| n as usize).sum()
    }

    /// Returns the mean over the pixels. Its standard error is that of independent tiles; a single tile has a standard error
    /// of its whole value.
    fn mean(&self) -> Mean {
        let value = self.sums.iter().sum::<f64>() / self.pixels().max(1) as f64;
        let tiles = self.counts.iter().filter(|&&n| n > 0).count();
        if tiles < 2 {
            return Mean { value, standard_error: value.abs() };
        }
        let deviation = |(sum, &n): (&f64, &u32)| (sum - value * f64::from(n)).powi(2);
        let squares: f64 = self.sums.iter().zip(&self.counts).map(deviation).sum();
        let corrected = squares * tiles as f64 / (tiles - 1) as f64;
        Mean { value, standard_error: corrected.sqrt() / self.pixels() as f64 }
    }

    /// Returns the mean of a tile; 0 without pixels.
    fn tile(&self, i: usize) -> f64 {
        self.sums[i] / f64::from(self.counts[i].max(1))
    }
}

impl Mean {
    /// Returns the logarithm of the value times a factor, and its standard deviation, which is at least `deviation`. A value
    /// that its noise hides counts as half of its standard error.
    fn logarithm(&self, factor: f64, deviation: f64) -> (f64, f64) {
        let value = self.value.max(0.5 * self.standard_error).max(f64::MIN_POSITIVE);
        ((factor * value).ln(), deviation.hypot(self.standard_error / value))
    }
}

/// Returns the errors of the tiles: the variance, or the risk where it is larger, in a scale in which their mean is `value`.
fn tile_errors([risk, variance]: &[Tiles; 2], value: f64) -> Planes {
    let errors: Vec<f64> = (0..risk.sums.len()).map(|i| variance.tile(i).max(risk.tile(i))).collect();
    let pixels = |i: usize| f64::from(risk.counts[i]);
    let mean = errors.iter().enumerate().map(|(i, error)| pixels(i) * error).sum::<f64>()
        / risk.pixels().max(1) as f64;
    let scale = if mean > 0.0 { value / mean } else { 0.0 };
    let mut tiles = Planes::new(risk.columns, risk.sums.len() / risk.columns.max(1), 1);
    for (i, (tile, error)) in tiles.data_mut().iter_mut().zip(&errors).enumerate() {
        // A tile without known pixels has the image's error
        *tile = if risk.counts[i] > 0 { (scale * error) as f32 } else { value as f32 };
    }
    tiles
}

#[cfg(test)]
mod tests;
