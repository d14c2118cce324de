//! The colours a filter starts from, and what its result says about its error.

use super::outliers::{self, Clamped, OutlierSettings};
use super::padded::Padded;
use super::{Filtered, LARGEST_RESIDUAL};
use crate::image::Planes;
use crate::stats::{Part, Store};

/// Deviation, in pixels, of the blur that makes the noisy estimate of squared bias usable.
const BIAS_BLUR: f32 = 4.0;

/// Variance below this share of the squared mean is rounding.
const LEAST_RELATIVE_VARIANCE: f32 = 1e-8;

/// Total radiance of a store.
pub(super) struct Colours {
    counts: [Vec<u32>; 2],
    /// As rendered.
    mean: Planes,
    /// Of the samples.
    variance: Planes,
    clamped: Clamped,
    /// A power of two that brings the image's mean near 1, so that no limit in the filter depends
    /// on the scene's brightness.
    exposure: f32,
}

impl Colours {
    pub fn new(store: &Store, settings: &OutlierSettings) -> Self {
        let dims = store.layout().radiance();
        let counts = [0, 1].map(|h| store.counts(Part::Half(h)));
        let mean = store.means(Part::Whole, dims.clone());
        let variance = store.variances(Part::Whole, dims.clone());
        let mut halves = [0, 1].map(|h| store.means(Part::Half(h), dims.clone()));
        // A half without samples says nothing against the other.
        for (half, counts) in halves.iter_mut().zip(&counts) {
            for (plane, mean) in half.planes_mut().zip(mean.data().chunks(mean.pixels().max(1))) {
                for ((value, &mean), &count) in plane.iter_mut().zip(mean).zip(counts) {
                    if count == 0 {
                        *value = mean;
                    }
                }
            }
        }
        let clamped = outliers::clamp(&mean, [&halves[0], &halves[1]], [&counts[0], &counts[1]], settings);
        let values = clamped.whole.data();
        let average = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len().max(1) as f64;
        let exposure = if average > 0.0 { (-average.log2().round()).exp2() as f32 } else { 1.0 };
        Self { counts, mean, variance, clamped, exposure }
    }

    pub fn exposure(&self) -> f32 {
        self.exposure
    }

    /// Means and variances to measure distances by: without outliers, at the common exposure.
    pub fn guide(&self) -> [Planes; 2] {
        let mut mean = self.clamped.whole.clone();
        let mut variance = self.variance.clone();
        for outlier in &self.clamped.outliers {
            variance.planes_mut().for_each(|plane| plane[outlier.pixel] *= outlier.scale * outlier.scale);
        }
        mean.data_mut().iter_mut().for_each(|v| *v *= self.exposure);
        // One factor at a time: the square may not be a number of single precision.
        variance.data_mut().iter_mut().for_each(|v| *v = *v * self.exposure * self.exposure);
        [mean, variance]
    }

    /// Channels to average: the mean, and the difference of the halves.
    pub fn values(&self, margin: usize) -> Padded {
        let (width, height) = (self.mean.width(), self.mean.height());
        let mut values = Planes::new(width, height, 6);
        let (means, differences) = values.data_mut().split_at_mut(self.mean.data().len());
        let [a, b] = &self.clamped.halves;
        for (i, (mean, difference)) in means.iter_mut().zip(differences).enumerate() {
            *mean = self.clamped.whole.data()[i] * self.exposure;
            *difference = (a.data()[i] - b.data()[i]) * self.exposure;
        }
        Padded::from_planes(&values, margin, 0.0)
    }

    /// The image and its halves from the averaged channels, what was cut off outliers spread over
    /// the pixels that resemble them.
    pub fn finish(
        &self,
        values: &Padded,
        settings: &OutlierSettings,
        resembles: impl Fn((usize, usize), (usize, usize)) -> bool + Sync,
    ) -> [Planes; 3] {
        let values = values.to_planes();
        let pixels = values.pixels();
        let [mut image, mut a, mut b] = [0; 3].map(|_| Planes::new(values.width(), values.height(), 3));
        let (means, differences) = values.data().split_at(3 * pixels);
        for (i, (mean, difference)) in means.iter().zip(differences).enumerate() {
            let [n_a, n_b] = [0, 1].map(|h| self.counts[h][i % pixels] as f32);
            // So that the mean by counts is the image.
            let of_a = if n_a + n_b > 0.0 { n_a / (n_a + n_b) } else { 0.5 };
            let (mean, difference) = (mean / self.exposure, difference / self.exposure);
            image.data_mut()[i] = mean;
            a.data_mut()[i] = mean + (1.0 - of_a) * difference;
            b.data_mut()[i] = mean - of_a * difference;
        }
        outliers::spread(&self.clamped.outliers, &mut [&mut image, &mut a, &mut b], settings, resembles);
        [image, a, b]
    }

    /// Completes a filter's result. With F the image, c the samples' mean and v its variance:
    /// variance is ¼(F_A − F_B)², residual (F − c)² ∕ (v + variance), and error the variance plus
    /// the squared bias (F − c)² − v, blurred because it is far noisier than itself large, where
    /// that is positive.
    pub fn assess(&self, [image, a, b]: [Planes; 3]) -> Filtered {
        let (width, height, pixels) = (image.width(), image.height(), image.pixels());
        let mut variance = Planes::new(width, height, 3);
        let mut residual = Planes::new(width, height, 1);
        let mut bias = Planes::new(width, height, 1);
        let mut error = Planes::new(width, height, 1);
        for i in 0..3 * pixels {
            let pixel = i % pixels;
            let n = (self.counts[0][pixel] + self.counts[1][pixel]) as f32;
            let v = 0.25 * (a.data()[i] - b.data()[i]).powi(2);
            variance.data_mut()[i] = v;
            error.data_mut()[pixel] += v / 3.0;
            // The variance of less than two samples is not known: then all is as expected.
            if n < 2.0 {
                residual.data_mut()[pixel] += 1.0 / 3.0;
                continue;
            }
            let noise = self.variance.data()[i] / n;
            let mean = self.mean.data()[i];
            let squared = (image.data()[i] - mean).powi(2);
            let expected = noise + v + LEAST_RELATIVE_VARIANCE * mean * mean + f32::MIN_POSITIVE;
            residual.data_mut()[pixel] += (squared / expected).min(LARGEST_RESIDUAL) / 3.0;
            bias.data_mut()[pixel] += (squared - noise) / 3.0;
        }
        blur(&mut bias, BIAS_BLUR);
        for (error, bias) in error.data_mut().iter_mut().zip(bias.data()) {
            *error += bias.max(0.0);
        }
        Filtered {
            image,
            halves: [a, b],
            interpolation_failure: None,
            interpolation_success: None,
            residual,
            variance,
            error,
        }
    }
}

/// Gaussian blur of all planes; at the borders the window is clipped.
fn blur(planes: &mut Planes, deviation: f32) {
    let radius = (3.0 * deviation) as usize;
    let kernel: Vec<f32> = (0..=radius).map(|d| (-0.5 * (d as f32 / deviation).powi(2)).exp()).collect();
    let (width, height) = (planes.width(), planes.height());
    for plane in planes.planes_mut() {
        for (size, step, lines, line_step) in [(width, 1, height, width), (height, width, width, 1)] {
            for line in 0..lines {
                let values: Vec<f32> = (0..size).map(|i| plane[line * line_step + i * step]).collect();
                for i in 0..size {
                    let (mut sum, mut total) = (0.0, 0.0);
                    for j in i.saturating_sub(radius)..=(i + radius).min(size - 1) {
                        let weight = kernel[i.abs_diff(j)];
                        sum += weight * values[j];
                        total += weight;
                    }
                    plane[line * line_step + i * step] = sum / total;
                }
            }
        }
    }
}
