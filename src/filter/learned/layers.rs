//! Filters layers that sum to the colour, such as light groups, with the weights of the colour.
//!
//! Takes the means of each layer in both halves of the samples, its image by `nlm` and the steps of the colour's filter;
//! gives the filtered layer. Every step is linear, so that the filtered layers sum to the filtered colour up to rounding.

use super::dual_image::DualImage;
use super::mixture::Candidates;
use super::network::Prediction;
use super::safeguard;
use crate::filter::common::fireflies::{Firefly, clamp_layer};
use crate::filter::common::half_counts::HalfCounts;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::image::Planes;

/// The steps of the colour's filter that layers repeat.
pub struct ColourSteps<'a> {
    pub counts: &'a HalfCounts,
    pub fireflies: &'a [Firefly],
    pub albedo: &'a Planes,
    pub predicted: &'a Prediction<'a>,
    pub hit: &'a InterleavedPlanes,
    /// The fraction of the learned image in its blend.
    pub fraction: &'a [f32],
    /// The factors that dim its fireflies and restore its brightness.
    pub factors: &'a [f32],
}

impl ColourSteps<'_> {
    /// Filters a layer. `nlm` is its image by that denoiser.
    pub fn filter(&self, mut layer: [Planes; 2], nlm: Planes) -> Planes {
        clamp_layer(&mut layer, self.fireflies);
        self.counts.fill_missing(&mut layer);
        let mean = self.counts.mean([&layer[0], &layer[1]]);
        let candidates = Candidates {
            colour: DualImage::new(mean, layer, self.counts),
            emission: None,
            albedo: self.albedo.clone(),
            nlm: DualImage::exact(nlm),
        };
        let mut mixed = candidates.filter_and_mix(self.predicted, self.hit);
        safeguard::blend(&mut mixed, &candidates.nlm, self.fraction);
        mixed.scale(self.factors);
        mixed.mean
    }
}
