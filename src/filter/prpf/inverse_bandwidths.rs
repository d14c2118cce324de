//! Inverse bandwidths of Eq. 4: the factors of squared differences in the exponent of the bilateral weight.
//!
//! Takes α, β and W_c^r of every pixel and the statistics of its neighbourhood. Returns a plane for each
//! feature and each colour, in units of one over the squared dimension. [`Bandwidth`] documents the
//! readings of the equation. RPF's bandwidth is that of the image's mean number of samples: a pixel that got few
//! because it has little noise must not be blurred for it. A pixel with more has that of the geometric mean of both
//! numbers: its own mean is sharp enough to be blurred less.

use rayon::prelude::*;

use super::feature_guide::FeatureGuide;
use super::neighbourhood::Neighbourhood;
use super::settings::Bandwidth;
use crate::filter::common::interleaved_planes::InterleavedPlanes;

/// Standard deviation relative to |mean| (at least 1) below which a dimension is constant up to rounding.
pub const ROUNDING: f32 = 1e-6;

/// Computes the inverse bandwidths of all pixels; 0 for constant dimensions.
pub fn inverse_bandwidths(
    guide: &FeatureGuide,
    neighbourhood: &Neighbourhood,
    weights: &InterleavedPlanes,
    bandwidth: Bandwidth,
) -> InterleavedPlanes {
    let dims = guide.features() + 3;
    let mut planes = InterleavedPlanes::new(guide.width(), guide.height(), dims, 0, 0.0);
    let (stride, row_len) = (planes.stride(), planes.row_len());
    planes.data_mut().par_chunks_mut(row_len.max(1)).enumerate().for_each(|(y, row)| {
        let counts = guide.counts.row(0, y);
        let colour_randomness = weights.row(dims, y);
        for (k, out) in row.chunks_mut(stride).enumerate() {
            let weight = weights.row(k, y);
            let variances = neighbourhood.variances(k, y);
            let means = neighbourhood.means(k, y);
            let own = guide.variances.row(k, y);
            for x in 0..counts.len() {
                // A pixel without samples has no values to measure distances from.
                if counts[x] == 0.0 || variances[x] <= (ROUNDING * means[x].abs().max(1.0)).powi(2) {
                    continue;
                }
                let factor = match bandwidth {
                    Bandwidth::RpfSigma { sigma8_squared } => {
                        let for_one = rpf_inverse_bandwidth(colour_randomness[x], sigma8_squared);
                        let samples = (guide.mean_count * counts[x].max(guide.mean_count)).sqrt();
                        samples * for_one / variances[x]
                    }
                    Bandwidth::Literal => 1.0 / (2.0 * own[x].max(ROUNDING * ROUNDING) * variances[x]),
                    Bandwidth::MeanVariance { kappa, rho } => {
                        counts[x] / (2.0 * kappa * (own[x] + rho * variances[x]))
                    }
                };
                out[x] = weight[x] * factor;
            }
        }
    });
    planes
}

/// 1 ∕ 2σ_c² of a pixel with one sample, for normalised values (Sen and Darabi 2012): σ_c² = 8 σ₈² ∕ (n (1 −
/// W_c^r)²).
pub fn rpf_inverse_bandwidth(colour_randomness: f32, sigma8_squared: f32) -> f32 {
    (1.0 - colour_randomness).powi(2) / (16.0 * sigma8_squared)
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::filter::common::colours::Colours;
    use crate::filter::prpf::settings::PrpfSettings;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::{Block, Layout};

    #[test]
    fn inverse_bandwidths_agree_with_the_formulas_of_all_readings() {
        // Prepare a noisy wall with different weights for every pixel and dimension
        let layout = Layout::with_blocks(|b| matches!(b, Block::Albedo));
        let count = |x: usize, _: usize| 2 + x as u32;
        let store = store(9, 5, layout.clone(), count, |x, y, _, rng| {
            let mut sample = wall(&layout, x, y, [rng.random(), 0.1 * rng.random::<f32>(), 1.0], rng);
            layout.write(&mut sample, Block::Albedo, &[0.5, rng.random(), x as f32]);
            sample
        });
        let settings = PrpfSettings::paper();
        let guide = FeatureGuide::new(&store, Colours::new(&store, &settings.fireflies).guide(), &settings);
        let neighbourhood = Neighbourhood::new(&guide, 7, 9);
        let dims = guide.features() + 3;
        let mut weights = InterleavedPlanes::new(9, 5, dims + 1, 0, 0.0);
        for (k, x, y) in (0..=dims).flat_map(|k| (0..45).map(move |i| (k, i % 9, i / 9))) {
            weights.set(k, x, y, 0.05 * (1 + k + x) as f32);
        }

        // Compare the readings with their formulas
        for bandwidth in [
            Bandwidth::RpfSigma { sigma8_squared: 0.003 },
            Bandwidth::Literal,
            Bandwidth::MeanVariance { kappa: 3.0, rho: 0.2 },
        ] {
            let found = inverse_bandwidths(&guide, &neighbourhood, &weights, bandwidth);
            let mut constant = 0;
            for (k, x, y) in (0..dims).flat_map(|k| (0..45).map(move |i| (k, i % 9, i / 9))) {
                let variance = neighbourhood.variance(k, x, y);
                // Standard deviations below 10⁻⁶ of the mean, or of 1, are rounding.
                let is_constant = variance.sqrt() <= 1e-6 * neighbourhood.mean(k, x, y).abs().max(1.0);
                let samples = match bandwidth {
                    // 6 in the mean
                    Bandwidth::RpfSigma { .. } => (6.0 * (2.0 + x as f32).max(6.0)).sqrt(),
                    Bandwidth::Literal => 1.0,
                    Bandwidth::MeanVariance { .. } => (2 + x) as f32,
                };
                let measure = match bandwidth {
                    // 2σ_c² of one sample times the neighbourhood's variance
                    Bandwidth::RpfSigma { .. } => {
                        2.0 * variance * 8.0 * 0.003 / (1.0 - weights.at(dims, x, y)).powi(2)
                    }
                    Bandwidth::Literal => 2.0 * guide.variances.at(k, x, y).max(1e-12) * variance,
                    Bandwidth::MeanVariance { .. } => {
                        2.0 * 3.0 * (guide.variances.at(k, x, y) + 0.2 * variance)
                    }
                };
                let expected = if is_constant { 0.0 } else { weights.at(k, x, y) * samples / measure };
                let error = (found.at(k, x, y) - expected).abs();
                assert!(
                    error <= 1e-4 * expected,
                    "{bandwidth:?} {k} {x} {y}: {} for {expected}",
                    found.at(k, x, y)
                );
                constant += usize::from(is_constant);
            }
            assert!(constant > 45 && constant < 45 * (dims - 2), "{constant} constant values");
        }
    }
}
