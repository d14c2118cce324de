//! Computes how much a pixel's directly visible emission is filtered.
//!
//! Its noise is that of which samples of a pixel meet an emitter, and little else. A filter mixes a dark pixel beside a sharp edge of an
//! emitter with bright neighbours. Its samples tell it from one within a blurred lamp: if the fraction α of them has met an emitter, and γ of
//! the filtered ones, the ratio of the likelihoods of α is exp(−n KL(α‖γ)) for n samples and binomial distributions. The pixel takes that
//! fraction of the filter, and its own emission for the rest. A pixel that is brighter than the filter makes it takes all of the filter, which
//! is there for chance meetings with a small lamp.

use std::ops::Range;

use rayon::prelude::*;

use super::dual_image::DualImage;
use crate::filter::common::TASK_PIXELS;
use crate::filter::common::fireflies::pixel_luminance;
use crate::filter::common::half_counts::HalfCounts;
use crate::image::{Planes, luminance};
use crate::stats::{Part, Store};

/// Directly visible emission of each pixel.
pub struct VisibleEmission {
    pub light: DualImage,
    /// Fraction of the samples that met an emitter: 1 plane.
    pub coverage: Planes,
    /// Number of samples.
    pub samples: Vec<f32>,
}

impl VisibleEmission {
    /// `dims` are the dimensions of emission in the store, and `mean` is theirs.
    pub fn new(store: &Store, dims: Range<usize>, mean: &Planes, counts: &HalfCounts) -> Self {
        let halves = [0, 1].map(|half| store.means(Part::Half(half), dims.clone()));
        let [a, b] = counts.floats();
        let samples: Vec<f32> = a.iter().zip(b).map(|(a, b)| a + b).collect();
        let coverage = coverage(mean, &store.variances(Part::Whole, dims), &samples);
        Self { light: DualImage::new(mean.clone(), halves, counts), coverage, samples }
    }

    /// Returns how much of the filter a pixel takes, in [0, 1]. `light` is the filtered emission, and `coverage` the fraction of the
    /// filtered samples that met an emitter.
    pub fn filtered_fraction(&self, pixel: usize, light: [f32; 3], coverage: f32) -> f32 {
        /// Samples that count at most: the filtered fraction is not exact. Of 4, 8 and all, this one lost least out of focus.
        const MOST_SAMPLES: f32 = 4.0;
        let (own, others) = (self.coverage.data()[pixel], coverage.min(1.0));
        let is_brighter = pixel_luminance(&self.light.mean, pixel) >= luminance(light);
        if is_brighter || own >= others {
            return 1.0;
        }
        let missed = (1.0 - own) * ((1.0 - own) / (1.0 - others).max(1e-6)).ln();
        let met = if own > 0.0 { own * (own / others).ln() } else { 0.0 };
        (-self.samples[pixel].min(MOST_SAMPLES) * (met + missed).max(0.0)).exp()
    }
}

/// Returns the fraction of the samples that met an emitter, as it follows from the moments of the brightest channel if emission is the
/// same in all of these.
fn coverage(mean: &Planes, variance: &Planes, samples: &[f32]) -> Planes {
    let mut fractions = Planes::new(mean.width(), mean.height(), 1);
    fractions.data_mut().par_iter_mut().with_min_len(TASK_PIXELS).enumerate().for_each(|(i, fraction)| {
        let at = |planes: &Planes, channel: usize| planes.plane(channel)[i];
        let brightest = (1..3).fold(0, |best, c| if at(mean, c) > at(mean, best) { c } else { best });
        let (light, deviation) = (at(mean, brightest), at(variance, brightest).sqrt());
        let n = samples[i].max(1.0);
        *fraction = if light > 0.0 { 1.0 / (1.0 + (deviation / light).powi(2) * (n - 1.0) / n) } else { 0.0 };
    });
    fractions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Block, Layout};

    /// Emission of a row of pixels with four samples each, of which `met` have met a lamp.
    fn emission(met: &[usize]) -> VisibleEmission {
        let layout = Layout::with_blocks(|block| block == Block::Emission);
        let mut store = Store::new(met.len(), 1, layout, 0, 0);
        let dims = store.layout().block(Block::Emission).unwrap();
        for (x, &met) in met.iter().enumerate() {
            for k in 0..4 {
                let mut sample = vec![0.0; store.layout().len()];
                sample[dims.clone()].fill(if k < met { 20.0 } else { 0.0 });
                store.push(x, 0, &sample);
            }
        }
        let mean = store.means(Part::Whole, dims.clone());
        VisibleEmission::new(&store, dims, &mean, &HalfCounts::from_store(&store))
    }

    #[test]
    fn the_moments_tell_how_many_samples_met_a_lamp() {
        let found = emission(&[0, 1, 2, 4]);
        for (found, expected) in found.coverage.data().iter().zip([0.0, 0.25, 0.5, 1.0]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn less_of_a_lamp_than_around_is_taken_for_chance_or_for_an_edge() {
        let found = emission(&[0, 1, 4]);
        let fraction = |pixel, coverage: f32| found.filtered_fraction(pixel, [20.0 * coverage; 3], coverage);
        // None of four samples: (1 − γ)⁴
        for (coverage, expected) in [(0.0, 1.0), (0.1, 0.6561), (0.5, 0.0625), (1.0, 0.0)] {
            assert!((fraction(0, coverage) - expected).abs() < 1e-5, "{coverage}");
        }
        // One of four: (1/2 ∕ 1/4) (1/2 ∕ 3/4)³
        assert!((fraction(1, 0.5) - 16.0 / 27.0).abs() < 1e-5);
        assert_eq!(fraction(1, 0.1), 1.0, "chance meetings are filtered");
        assert_eq!(found.filtered_fraction(1, [1.0; 3], 0.5), 1.0, "a brighter emitter than around");
        assert_eq!((fraction(2, 0.7), fraction(2, 1.0 + f32::EPSILON)), (1.0, 1.0));
    }
}
