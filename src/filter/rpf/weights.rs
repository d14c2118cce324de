//! Weights of colours and features from the mutual information over the samples of a neighbourhood (paper,
//! section 4; the formulas are those of P-RPF), and the scale that they give to differences.

use super::neighbourhood::Neighbourhood;
use super::settings::RpfSettings;
use crate::filter::prpf::bit_slices::{BLOCK_SAMPLES, BinLimits, BitSlices, Standardisation};
use crate::filter::prpf::inverse_bandwidths::{ROUNDING, rpf_inverse_bandwidth};
use crate::filter::prpf::sample_vector::{MAX_VARIABLES, SampleVector};
use crate::filter::prpf::variables::{Damping, Variables};
use crate::stats::{Feature, Layout};

/// Evaluates the weights of one pixel after the other.
pub struct Weights {
    variables: Variables,
    kinds: Vec<Feature>,
    /// Magnitude of each dimension, if its mean is smaller, relative to which a standard deviation may be rounding.
    min_magnitude: SampleVector,
    slices: BitSlices,
    /// β of each feature, α of each colour, W_c^r.
    weights: Vec<f32>,
    scale: SampleVector,
}

impl Weights {
    pub fn new(layout: &Layout) -> Self {
        let (dims, kinds): (Vec<usize>, Vec<Feature>) = layout.features().into_iter().unzip();
        let variables = Variables::new(layout, &dims);
        // All dimensions but radiance are of order 1
        let mut min_magnitude = [1.0; MAX_VARIABLES];
        layout.radiance().for_each(|dim| min_magnitude[dim] = 0.0);
        let weights = vec![0.0; variables.features.len() + variables.colours.len() + 1];
        Self {
            variables,
            kinds,
            min_magnitude,
            slices: BitSlices::default(),
            weights,
            scale: [0.0; MAX_VARIABLES],
        }
    }

    /// Evaluates the weights in pass `t` for a pixel with `own` samples. Returns the scale of each dimension
    /// with which the sum of squared differences is the filter's exponent; 0 for dimensions without weight.
    pub fn evaluate(
        &mut self,
        neighbourhood: &Neighbourhood,
        settings: &RpfSettings,
        t: usize,
        own: usize,
    ) -> &SampleVector {
        let standardisation = self.standardisation(neighbourhood);
        let limits = BinLimits::new(&standardisation);
        self.slices.clear();
        for block in neighbourhood.rows().chunks(BLOCK_SAMPLES) {
            let mut samples: [&[f32]; BLOCK_SAMPLES] = [&[]; BLOCK_SAMPLES];
            samples.iter_mut().zip(block).for_each(|(to, sample)| *to = sample);
            self.slices.push(&samples[..block.len()], &limits, &self.variables.dims);
        }
        self.slices.finish();
        let damping = |[first, growth]: [f32; 2]| first + growth * t as f32;
        let damping = Damping {
            colours: damping(settings.colour_damping),
            features: damping(settings.feature_damping),
        };
        self.variables.weigh(&self.slices, neighbourhood.len(), damping, &mut self.weights);
        self.scale(&standardisation, settings, own);
        &self.scale
    }

    /// Returns the weights that were evaluated last: β of each feature, α of each colour, W_c^r.
    pub fn latest(&self) -> &[f32] {
        &self.weights
    }

    fn standardisation(&self, neighbourhood: &Neighbourhood) -> Standardisation {
        let (mean, variance) = neighbourhood.moments();
        let mut scale = [0.0; MAX_VARIABLES];
        for &dim in &self.variables.dims {
            let deviation = variance[dim].sqrt();
            if deviation > ROUNDING * mean[dim].abs().max(self.min_magnitude[dim]) {
                scale[dim] = 1.0 / deviation;
            }
        }
        Standardisation { mean, scale }
    }

    fn scale(&mut self, standardisation: &Standardisation, settings: &RpfSettings, own: usize) {
        let [albedo, normal] = settings.feature_boosts;
        let boosts = self.kinds.iter().map(|kind| match kind {
            Feature::Albedo => albedo,
            Feature::Normal => normal,
            Feature::WorldPosition => 1.0,
        });
        let randomness = self.weights[self.weights.len() - 1];
        let factor = own as f32 * rpf_inverse_bandwidth(randomness, settings.sigma8_squared);
        let dims = &self.variables.dims[self.variables.features.start..];
        self.scale = [0.0; MAX_VARIABLES];
        for ((&dim, weight), boost) in dims.iter().zip(&self.weights).zip(boosts.chain([1.0; 3])) {
            self.scale[dim] = standardisation.scale[dim] * (factor * boost * weight).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::Samples;
    use super::super::tests::{candidates, one_pixel};
    use super::*;
    use crate::stats::Block;

    /// Evaluates samples made of all 64 combinations of six bits, which are exactly independent. Two are the
    /// lens sample, two the position and one is a texture; `sample` fills the rest of the vector.
    fn evaluate(
        layout: &Layout,
        t: usize,
        sample: impl Fn(&mut [f32], [f32; 5]),
    ) -> (Vec<f32>, SampleVector) {
        let samples: Vec<Vec<f32>> = (0..64)
            .map(|i| {
                let bits @ [u, v, x, y, _] = [0, 1, 2, 3, 4].map(|bit| (i >> bit & 1) as f32);
                let mut vector = vec![0.0; layout.len()];
                layout.write(&mut vector, Block::Lens, &[u, v]);
                layout.write(&mut vector, Block::Film, &[x, y]);
                sample(&mut vector, bits);
                vector
            })
            .collect();
        let store = one_pixel(layout, &samples);
        let samples = Samples::from_store(&store);
        let (sampler, clustering) = candidates(&samples, layout);
        let mut neighbourhood = Neighbourhood::new(&sampler, &samples);
        let settings = RpfSettings::report();
        neighbourhood.gather(&samples, &sampler, &clustering, (0, 0), (1, t));
        let mut weights = Weights::new(layout);
        let scale = *weights.evaluate(&neighbourhood, &settings, t, 64);
        (weights.weights, scale)
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() < 1e-3 * b.abs().max(1.0)
    }

    #[test]
    fn weights_agree_with_those_computed_by_hand() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Lens));
        let (weights, scale) = evaluate(&layout, 0, |vector, [u, _, x, _, texture]| {
            layout.write(vector, Block::Colour, &[u, x, texture]);
            layout.write(vector, Block::Albedo, &[texture, u, x]);
        });
        // Each colour shares one bit with its cause and one with the feature of the same cause, for red,
        // green and blue u, x and none: 5 bits, 3 of them with features. The texture depends on neither
        // random parameters nor positions, so that its randomness is a half.
        let [texture_weight, lens_weight, position_weight, red, green, blue, randomness] = weights[..] else {
            panic!("three features, three colours and the randomness")
        };
        assert!(close(randomness, (1.0 + 0.0 + 0.5) / 3.0), "{randomness}");
        assert!(close(red, 0.0) && close(green, 1.0) && close(blue, 0.0), "{weights:?}");
        assert!(close(texture_weight, 0.5 / 5.0), "{texture_weight}");
        assert!(close(lens_weight, 0.0) && close(position_weight, 1.0 / 5.0), "{weights:?}");
        // 1 ∕ σ̂ = 2, and √(β n (1 − W)² ∕ 16 σ₈²).
        let dim = layout.block(Block::Albedo).unwrap().start + 2;
        let expected = 2.0 * (0.2 * 64.0 * 0.25 / (16.0 * 0.002_f32)).sqrt();
        assert!(close(scale[dim], expected), "{} for {expected}", scale[dim]);
        assert_eq!(scale[layout.randoms()[0]], 0.0, "random parameters do not enter distances");
    }

    #[test]
    fn randomness_reduces_weights_more_in_each_pass() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Lens));
        let texture_weight = |t: usize| {
            let fill = |vector: &mut [f32], [_, _, x, _, texture]: [f32; 5]| {
                layout.write(vector, Block::Colour, &[texture, x, 0.0]);
                layout.write(vector, Block::Albedo, &[texture, 0.0, 0.0]);
            };
            evaluate(&layout, t, fill).0[0]
        };
        // Of two bits of information one is with the texture.
        assert!(close(texture_weight(0), 0.5 * 0.5), "{}", texture_weight(0));
        assert!(close(texture_weight(3), 0.5 * (1.0 - 1.3 * 0.5)), "{}", texture_weight(3));
    }

    #[test]
    fn independent_features_get_no_weight() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Lens));
        let (weights, scale) = evaluate(&layout, 0, |vector, [_, _, x, _, texture]| {
            layout.write(vector, Block::Colour, &[x, x, x]);
            layout.write(vector, Block::Albedo, &[texture; 3]);
        });
        assert!(weights[..3].iter().all(|&beta| beta < 1e-5), "{weights:?}");
        assert!(weights[3..6].iter().all(|&alpha| close(alpha, 1.0)), "{weights:?}");
        assert!(scale[layout.block(Block::Albedo).unwrap()].iter().all(|&scale| scale < 0.5), "{scale:?}");
    }
}
