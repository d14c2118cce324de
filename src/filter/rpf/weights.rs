//! From a neighbourhood to what differences count: mutual information over its samples (paper, section
//! 4; the formulas are those of P-RPF and shared with it).

use super::neighbourhood::Neighbourhood;
use super::settings::RpfSettings;
use crate::filter::bilateral::{CONSTANT, rpf_factor};
use crate::filter::mutual_information::{BitSlices, LANES, Standard, WORD};
use crate::filter::weights::{Damping, Variables};
use crate::stats::{Feature, Layout};

/// Evaluates the weights of one pixel after the other.
pub(super) struct Weights {
    variables: Variables,
    kinds: Vec<Feature>,
    /// Dimensions that are 0 throughout for rounding only if they are so beside 1.
    of_order_1: [bool; LANES],
    slices: BitSlices,
    /// β of each feature, α of each colour, W_c^r.
    weights: Vec<f32>,
    scale: [f32; LANES],
}

impl Weights {
    pub fn new(layout: &Layout) -> Self {
        let (dims, kinds): (Vec<usize>, Vec<Feature>) = layout.features().into_iter().unzip();
        let variables = Variables::new(layout, &dims);
        let mut of_order_1 = [true; LANES];
        layout.radiance().for_each(|dim| of_order_1[dim] = false);
        let weights = vec![0.0; variables.features.len() + variables.colours.len() + 1];
        Self { variables, kinds, of_order_1, slices: BitSlices::default(), weights, scale: [0.0; LANES] }
    }

    /// Weighs the dimensions in pass `t` for a pixel with `own` samples. Returns what their values are to be
    /// multiplied by for the sum of squared differences to be the filter's exponent; 0 where they do not
    /// count.
    pub fn evaluate(
        &mut self,
        neighbourhood: &Neighbourhood,
        settings: &RpfSettings,
        t: usize,
        own: usize,
    ) -> &[f32; LANES] {
        let standard = self.standard(neighbourhood);
        self.slices.clear();
        let mut left = neighbourhood.len();
        for block in neighbourhood.blocks() {
            let count = left.min(WORD);
            self.slices.push(block, count, &standard, &self.variables.dims);
            left -= count;
        }
        let damping = |[first, growth]: [f32; 2]| first + growth * t as f32;
        let damping = Damping {
            colours: damping(settings.colour_damping),
            features: damping(settings.feature_damping),
        };
        self.variables.weigh(&self.slices, neighbourhood.len(), damping, &mut self.weights);
        self.scale(&standard, settings, own);
        &self.scale
    }

    /// What was evaluated last: β of each feature, α of each colour, W_c^r.
    pub fn latest(&self) -> &[f32] {
        &self.weights
    }

    fn standard(&self, neighbourhood: &Neighbourhood) -> Standard {
        let (mean, variance) = neighbourhood.moments();
        let mut scale = [0.0; LANES];
        for &dim in &self.variables.dims {
            let deviation = variance[dim].sqrt();
            let unit = if self.of_order_1[dim] { 1.0 } else { 0.0 };
            if deviation > CONSTANT * mean[dim].abs().max(unit) {
                scale[dim] = 1.0 / deviation;
            }
        }
        Standard { mean, scale }
    }

    fn scale(&mut self, standard: &Standard, settings: &RpfSettings, own: usize) {
        let [albedo, normal] = settings.boosts;
        let boosts = self.kinds.iter().map(|kind| match kind {
            Feature::Albedo => albedo,
            Feature::Normal => normal,
            Feature::WorldPosition => 1.0,
        });
        let randomness = self.weights[self.weights.len() - 1];
        let factor = own as f32 * rpf_factor(randomness, settings.sigma8_squared);
        let dims = &self.variables.dims[self.variables.features.start..];
        self.scale = [0.0; LANES];
        for ((&dim, weight), boost) in dims.iter().zip(&self.weights).zip(boosts.chain([1.0; 3])) {
            self.scale[dim] = standard.scale[dim] * (factor * boost * weight).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::Samples;
    use super::super::tests::{draws, one_pixel};
    use super::*;
    use crate::stats::Block;

    /// All 64 combinations of six bits: exactly independent of each other. Two are the lens numbers, two the
    /// position, one is a texture of its own; `sample` makes the rest of the vector of them.
    fn evaluate(
        layout: &Layout,
        t: usize,
        sample: impl Fn(&mut [f32], [f32; 5]),
    ) -> (Vec<f32>, [f32; LANES]) {
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
        let samples = Samples::of(&store);
        let draws = draws(&samples, layout);
        let mut neighbourhood = Neighbourhood::new(&draws);
        let settings = RpfSettings::report();
        neighbourhood.gather(&samples, &draws, &settings, (0, 0), (1, t));
        let mut weights = Weights::new(layout);
        let scale = *weights.evaluate(&neighbourhood, &settings, t, 64);
        (weights.weights, scale)
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() < 1e-3 * b.abs().max(1.0)
    }

    #[test]
    fn weights_are_those_computed_by_hand() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Lens));
        let (weights, scale) = evaluate(&layout, 0, |vector, [u, _, x, _, texture]| {
            layout.write(vector, Block::Colour, &[u, x, texture]);
            layout.write(vector, Block::Albedo, &[texture, u, x]);
        });
        // Each colour shares one bit with its cause and one with the feature of the same cause, red, green and
        // blue that is u, x, none in turn: 5 bits, 3 of them with features. Of the texture, nothing is known of
        // neither randoms nor positions: it is half random.
        let [of_texture, of_lens, of_position, red, green, blue, randomness] = weights[..] else {
            panic!("three features, three colours and a share")
        };
        assert!(close(randomness, (1.0 + 0.0 + 0.5) / 3.0), "{randomness}");
        assert!(close(red, 0.0) && close(green, 1.0) && close(blue, 0.0), "{weights:?}");
        assert!(close(of_texture, 0.5 / 5.0), "{of_texture}");
        assert!(close(of_lens, 0.0) && close(of_position, 1.0 / 5.0), "{weights:?}");
        // 1 ∕ σ̂ = 2, and √(β n (1 − W)² ∕ 16 σ₈²).
        let dim = layout.block(Block::Albedo).unwrap().start + 2;
        let expected = 2.0 * (0.2 * 64.0 * 0.25 / (16.0 * 0.002_f32)).sqrt();
        assert!(close(scale[dim], expected), "{} for {expected}", scale[dim]);
        assert_eq!(scale[layout.randoms()[0]], 0.0, "random numbers are no distance");
    }

    #[test]
    fn randomness_counts_more_with_each_pass() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Lens));
        let of_texture = |t: usize| {
            let fill = |vector: &mut [f32], [_, _, x, _, texture]: [f32; 5]| {
                layout.write(vector, Block::Colour, &[texture, x, 0.0]);
                layout.write(vector, Block::Albedo, &[texture, 0.0, 0.0]);
            };
            evaluate(&layout, t, fill).0[0]
        };
        // Two bits in all, one of them with the texture.
        assert!(close(of_texture(0), 0.5 * 0.5), "{}", of_texture(0));
        assert!(close(of_texture(3), 0.5 * (1.0 - 1.3 * 0.5)), "{}", of_texture(3));
    }

    #[test]
    fn what_is_independent_of_everything_shares_nothing_and_gets_no_weight() {
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
