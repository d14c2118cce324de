//! Filters layers that sum to the colour, such as light groups, with the weights of the colour.
//!
//! Takes the means of each layer in both halves of the samples and the steps of the colour's filter; gives the filtered
//! layers. They sum to the filtered colour up to rounding: every step of the filter is linear but for fits that would get
//! negative and the blurred excess of fireflies, whose rest is distributed in proportion to the layers.

use super::NlmSettings;
use super::blend::mix;
use super::cross_filtering::{filter_layer, fit_layer};
use crate::filter::common::dual_buffer::DualBuffer;
use crate::filter::common::fireflies::{Firefly, clamp_layer};
use crate::filter::common::half_counts::HalfCounts;
use crate::filter::whole_image::WholeImage;
use crate::image::Planes;

/// The steps of the colour's filter that layers repeat.
pub struct ColourSteps<'a> {
    /// The clamped colour.
    pub noisy: &'a DualBuffer,
    pub counts: &'a HalfCounts,
    pub fireflies: &'a [Firefly],
    /// Filtered normals and albedo of both halves.
    pub features: [Option<&'a [Planes; 2]>; 2],
    /// The fraction of the weighted mean in its blend with the fit, if there is a fit.
    pub fraction: Option<&'a [f32]>,
    pub settings: &'a NlmSettings,
    pub whole: &'a dyn WholeImage,
}

impl ColourSteps<'_> {
    /// Filters layers. `colour` are the filtered halves that they sum to.
    pub fn filter(&self, layers: &[[Planes; 2]], colour: [&Planes; 2]) -> Vec<Planes> {
        let mut filtered: Vec<[Planes; 2]> =
            layers.iter().map(|layer| self.filter_one(layer.clone())).collect();
        for (h, colour) in colour.into_iter().enumerate() {
            distribute_rest(&mut filtered, h, colour);
        }
        filtered.iter().map(|[a, b]| self.counts.mean([a, b])).collect()
    }

    fn filter_one(&self, mut layer: [Planes; 2]) -> [Planes; 2] {
        clamp_layer(&mut layer, self.fireflies);
        self.counts.fill_missing(&mut layer);
        let [normal, albedo] = self.features;
        let mut filtered = filter_layer(&layer, self.noisy, normal, albedo, self.settings, self.whole);
        if let Some(fraction) = self.fraction {
            let k = self.settings.fit_k;
            let fitted = fit_layer(&layer, self.noisy, self.features, k, self.settings, self.whole);
            filtered = mix(filtered, &fitted, fraction);
        }
        filtered.map(|half| half.value)
    }
}

/// Adds to each layer its part of what the sum of the layers lacks of a half of the colour.
fn distribute_rest(layers: &mut [[Planes; 2]], half: usize, colour: &Planes) {
    let count = layers.len() as f32;
    for (i, &colour) in colour.data().iter().enumerate() {
        let values = || layers.iter().map(|layer| layer[half].data()[i]);
        let (sum, magnitude): (f32, f32) = (values().sum(), values().map(f32::abs).sum());
        let rest = colour - sum;
        for layer in layers.iter_mut() {
            let value = &mut layer[half].data_mut()[i];
            *value += rest * if magnitude > 0.0 { value.abs() / magnitude } else { 1.0 / count };
        }
    }
}
