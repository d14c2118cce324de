//! Directly visible emission: its noise is that of which samples of a pixel meet an emitter, and little else.
//!
//! A filter mixes a pixel beside a sharp edge of an emitter with bright neighbours. Its samples tell it from one within a blurred lamp: if the
//! fraction α of them has met an emitter, and γ of the filtered ones, the ratio of the likelihoods of α is exp(−n KL(α‖γ)) for n samples
//! and binomial distributions. Where α is less than γ, only that fraction of the filter's emission is taken. The other way round nothing
//! changes: chance meetings with a small lamp are what it filters.

use std::ops::Range;

use rayon::prelude::*;

use super::mixture::Noisy;
use crate::filter::common::half_counts::HalfCounts;
use crate::image::Planes;
use crate::stats::{Part, Store};

/// Directly visible emission of each pixel.
pub struct VisibleEmission {
    pub light: Noisy,
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
        Self { light: Noisy::new(mean.clone(), halves, counts), coverage, samples }
    }

    /// Returns the fraction of the filtered emission that a pixel takes. `filtered`: the fraction of the filtered samples that met an
    /// emitter.
    pub fn accepted(&self, pixel: usize, filtered: f32) -> f32 {
        /// Samples that count at most: the filtered fraction is not exact. Of 4, 8 and all, this one lost least out of focus.
        const MOST_SAMPLES: f32 = 4.0;
        let own = self.coverage.data()[pixel];
        if own >= filtered {
            return 1.0;
        }
        let rest = (1.0 - own) * ((1.0 - own) / (1.0 - filtered).max(1e-6)).ln();
        let divergence = if own > 0.0 { rest + own * (own / filtered).ln() } else { rest };
        (-self.samples[pixel].min(MOST_SAMPLES) * divergence.max(0.0)).exp()
    }
}

/// Returns the fraction of the samples that met an emitter, as it follows from the moments of the brightest channel, with the emission the same
/// in all of these.
fn coverage(mean: &Planes, variance: &Planes, samples: &[f32]) -> Planes {
    let mut coverage = Planes::new(mean.width(), mean.height(), 1);
    coverage.data_mut().par_iter_mut().with_min_len(1024).enumerate().for_each(|(i, coverage)| {
        let at = |planes: &Planes, channel: usize| planes.plane(channel)[i];
        let brightest = (1..3).fold(0, |best, c| if at(mean, c) > at(mean, best) { c } else { best });
        let (mean, deviation) = (at(mean, brightest), at(variance, brightest).sqrt());
        let n = samples[i].max(1.0);
        *coverage = if mean > 0.0 { 1.0 / (1.0 + (deviation / mean).powi(2) * (n - 1.0) / n) } else { 0.0 };
    });
    coverage
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
        // None of four samples: (1 − γ)⁴
        for (filtered, expected) in [(0.0, 1.0), (0.1, 0.6561), (0.5, 0.0625), (1.0, 0.0)] {
            assert!((found.accepted(0, filtered) - expected).abs() < 1e-5, "{filtered}");
        }
        // One of four: (1/2 ∕ 1/4) (1/2 ∕ 3/4)³
        assert!((found.accepted(1, 0.5) - 16.0 / 27.0).abs() < 1e-5);
        assert_eq!(found.accepted(1, 0.1), 1.0, "chance meetings are filtered");
        assert_eq!(found.accepted(2, 0.7), 1.0);
    }
}
