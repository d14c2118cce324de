//! From a neighbourhood to what differences count: mutual information over its samples (paper, section
//! 4; the formulas are those of P-RPF and shared with it).

use super::neighbourhood::{Draws, Neighbourhood};
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
    pub fn new(layout: &Layout, draws: &Draws) -> Self {
        let (dims, kinds): (Vec<usize>, Vec<Feature>) = layout.features().into_iter().unzip();
        let variables = Variables::new(layout, &dims);
        let mut of_order_1 = [true; LANES];
        layout.radiance().for_each(|dim| of_order_1[dim] = false);
        let weights = vec![0.0; variables.features.len() + variables.colours.len() + 1];
        let slices = BitSlices::new(draws.most_samples());
        Self { variables, kinds, of_order_1, slices, weights, scale: [0.0; LANES] }
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
