//! Dual buffers: means of three dimensions in each half of the samples, and the variances of these means.
//!
//! Takes a store and its sample counts. The variance is s²∕n with a pooled sample variance, corrected by the
//! difference of the halves.

use std::ops::Range;

use rayon::prelude::*;

use super::TASK_PIXELS;
use super::fireflies::{self, FireflyClamp, FireflySettings};
use super::half_counts::HalfCounts;
use super::variance_correction::variance_correction;
use super::variance_pooling::pool_planes;
use crate::image::Planes;
use crate::stats::Store;

/// Three dimensions of a store in each half of the samples.
#[derive(Clone, Debug)]
pub struct DualBuffer {
    /// Mean of each half: 3 planes.
    pub mean: [Planes; 2],
    /// Variance of that mean: 3 planes.
    pub variance: [Planes; 2],
}

impl DualBuffer {
    /// Reads three dimensions of a store. A half without samples in a pixel gets the other half's mean, and
    /// pixels without samples that of their nearest neighbours.
    pub fn from_store(store: &Store, dims: Range<usize>, counts: &HalfCounts) -> Self {
        let (mean, sample_variance) = store.halves(dims);
        Self::new(mean, sample_variance, counts)
    }

    /// Reads three dimensions of a store and clamps fireflies. The variance of a firefly is scaled by the
    /// square of the factor that its luminance is scaled by.
    pub fn from_store_clamped(
        store: &Store,
        dims: Range<usize>,
        counts: &HalfCounts,
        settings: &FireflySettings,
    ) -> (Self, FireflyClamp) {
        let (mean, mut sample_variance) = store.halves(dims);
        let [a, b] = &mean;
        let clamped = fireflies::clamp(&counts.mean([a, b]), [a, b], counts.integers(), settings);
        for firefly in &clamped.fireflies {
            let factor = firefly.scale * firefly.scale;
            sample_variance.planes_mut().for_each(|plane| plane[firefly.pixel] *= factor);
        }
        (Self::new(clamped.halves.clone(), sample_variance, counts), clamped)
    }

    /// `sample_variance` is the unbiased variance of all samples of a pixel.
    fn new(mut mean: [Planes; 2], mut sample_variance: Planes, counts: &HalfCounts) -> Self {
        counts.fill_missing(&mut mean);
        if sample_variance.data().iter().all(|&v| v == 0.0) && counts.have_variances() {
            // Noise-free, as the normals of a still scene without a lens are inside surfaces
            return Self { mean, variance: [sample_variance.clone(), sample_variance] };
        }

        // Compute s²∕n
        let [n_a, n_b] = counts.floats();
        let totals: Vec<f32> = n_a.iter().zip(n_b).map(|(a, b)| a + b).collect();
        pool_planes(&mut sample_variance, &mean[0], &totals);
        let mut variance = [sample_variance.clone(), sample_variance];
        for (variance, count) in variance.iter_mut().zip(counts.floats()) {
            variance.planes_mut().par_bridge().for_each(|plane| {
                plane.iter_mut().zip(count).for_each(|(v, n)| *v /= n.max(0.5));
            });
        }

        // Correct it by the difference of the halves
        let correction = variance_correction(&mean, &variance, counts);
        for variance in &mut variance {
            variance.planes_mut().par_bridge().for_each(|plane| {
                plane.iter_mut().zip(&correction).for_each(|(v, &factor)| *v *= factor);
            });
        }
        Self { mean, variance }
    }

    /// Divides each half by a divisor of 3 planes.
    pub fn divide(&mut self, divisor: [&Planes; 2]) {
        for ((mean, variance), divisor) in self.mean.iter_mut().zip(&mut self.variance).zip(divisor) {
            let values = mean.data_mut().par_iter_mut().with_min_len(TASK_PIXELS).zip(variance.data_mut());
            values.zip(divisor.data()).for_each(|((mean, variance), &d)| {
                *mean /= d;
                *variance /= d * d;
            });
        }
    }
}

/// Computes a result for each half, in parallel.
pub fn both_halves<T: Send>(compute: impl Fn(usize) -> T + Sync) -> [T; 2] {
    let (a, b) = rayon::join(|| compute(0), || compute(1));
    [a, b]
}

#[cfg(test)]
mod tests;
