//! Weights of colours and features from mutual information (paper, section 4.2, Eqs. 5 to 10).
//!
//! Takes the bit-sliced samples of a neighbourhood. Returns α of each colour, β of each feature and the
//! randomness W_c^r of the colour, all in [0, 1]. Random parameter filtering uses the same formulas.

use std::ops::Range;

use super::bit_slices::BitSlices;
use super::sample_vector::{MAX_VARIABLES, SampleVector};
use crate::stats::Layout;

/// Mutual information, in bits, that is added to every pair of variables. It avoids 0/0 if nothing depends on
/// anything; the randomness is then the fraction of random parameters among random parameters and positions.
const MIN_INFORMATION: f32 = 1e-4;

/// Minimum number of samples for an estimate of mutual information.
const MIN_SAMPLES: usize = 32;

/// The variables whose mutual information is estimated, in groups. Each group depends on those before it.
pub struct Variables {
    /// Layout indices.
    pub dims: Vec<usize>,
    pub randoms: Range<usize>,
    pub positions: Range<usize>,
    pub features: Range<usize>,
    pub colours: Range<usize>,
}

/// Factors of the randomness in one pass: α = max(1 − colours·W_c^r, 0), and β likewise with `features` and W_f^r.
#[derive(Clone, Copy, Debug)]
pub struct Damping {
    pub colours: f32,
    pub features: f32,
}

impl Variables {
    /// `features` are layout indices.
    pub fn new(layout: &Layout, features: &[usize]) -> Self {
        let mut dims = layout.randoms();
        let randoms = 0..dims.len();
        dims.extend(layout.film());
        let positions = randoms.end..dims.len();
        dims.extend(features);
        let features = positions.end..dims.len();
        dims.extend(layout.radiance());
        let colours = features.end..dims.len();
        Self { dims, randoms, positions, features, colours }
    }

    /// Returns W^r of a variable: the dependence on random parameters over the dependence on random parameters and
    /// positions. `information` is its mutual information with each variable.
    fn randomness(&self, information: &SampleVector) -> f32 {
        let total = |group: &Range<usize>| {
            information[group.clone()].iter().sum::<f32>() + MIN_INFORMATION * group.len() as f32
        };
        let random = total(&self.randoms);
        random / (random + total(&self.positions))
    }

    /// Computes the weights from `samples` samples: writes β of each feature, α of each colour, and W_c^r.
    /// With too few samples colours get no weight and features equal ones.
    pub fn weigh(&self, slices: &BitSlices, samples: usize, damping: Damping, weights: &mut [f32]) {
        let (beta, rest) = weights.split_at_mut(self.features.len());
        let (alpha, colour_randomness) = rest.split_at_mut(self.colours.len());
        if samples < MIN_SAMPLES {
            alpha.fill(0.0);
            beta.fill(1.0 / self.features.len() as f32);
            colour_randomness[0] = self.randomness(&[0.0; MAX_VARIABLES]);
            return;
        }

        // Compute α, W_c^r, D_c^r + D_c^p + D_c^f, and D_c^{f,l} of each feature l
        let mut dependence = 0.0;
        let mut feature_dependence = [0.0; MAX_VARIABLES];
        colour_randomness[0] = 0.0;
        for (k, alpha) in self.colours.clone().zip(&mut *alpha) {
            let information = slices.mutual_information(k, self.features.end);
            let randomness = self.randomness(&information);
            *alpha = (1.0 - damping.colours * randomness).max(0.0);
            colour_randomness[0] += randomness / self.colours.len() as f32;
            dependence += information[..self.features.end].iter().sum::<f32>();
            let on_features = &information[self.features.clone()];
            feature_dependence.iter_mut().zip(on_features).for_each(|(sum, bits)| *sum += bits);
        }

        // Compute β
        for ((k, beta), on_feature) in self.features.clone().zip(beta).zip(feature_dependence) {
            let randomness = self.randomness(&slices.mutual_information(k, self.positions.end));
            let fraction = on_feature / (dependence + f32::MIN_POSITIVE);
            *beta = fraction * (1.0 - damping.features * randomness).max(0.0);
        }
    }
}

/// Names of the values that [`Variables::weigh`] writes.
pub fn weight_names(layout: &Layout) -> Vec<String> {
    let name = |(dim, _): (usize, _)| format!("beta {}", layout.dimensions()[dim].name);
    let others = ["alpha R", "alpha G", "alpha B", "randomness"].map(str::to_owned);
    layout.features().into_iter().map(name).chain(others).collect()
}
