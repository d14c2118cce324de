//! Mixes the candidates of a pixel: the filtered colour, the filtered demodulated colour times albedo, the sample means, and
//! the image of `nlm`. The network predicts the weights, which sum to 1.

use rayon::prelude::*;

use super::affinity::{self, MARGIN};
use super::dual_image::DualImage;
use super::input_statistics::ALBEDO_RANGE;
use super::network::{MIXTURE, Prediction};
use super::visible_emission::VisibleEmission;
use crate::filter::common::TASK_PIXELS;
use crate::filter::common::emitter_outlines::outside_emitters;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::image::Planes;

/// First planes, of 3 each, in a part of what [`Candidates::values`] returns.
const DEMODULATED: usize = 0;
const COLOUR: usize = 3;
const EMISSION: usize = 6;

/// What is filtered and mixed.
pub struct Candidates {
    /// Radiance without directly visible emission.
    pub colour: DualImage,
    /// Directly visible emission, if there is any.
    pub emission: Option<VisibleEmission>,
    /// Albedo of surfaces: 3 planes.
    pub albedo: Planes,
    /// Image of `nlm`, without emission.
    pub nlm: DualImage,
}

/// Weights of the mixture at a pixel, whose own colour has the rest of 1.
#[derive(Clone, Copy)]
struct MixtureWeights {
    /// Surfaces filtered without their albedo.
    demodulated: f32,
    /// Surfaces filtered with it.
    plain: f32,
    nlm: f32,
    /// Fraction of the filtered albedo in the one that is multiplied by; the rest is the pixel's own.
    albedo: f32,
    /// Fraction of the filtered emission; the rest is the pixel's own.
    emission: f32,
}

impl MixtureWeights {
    fn new(predicted: [f32; MIXTURE]) -> Self {
        /// Greatest magnitude of a logarithmic weight.
        const MAX_LOG: f32 = 8.0;
        // Wrong weights may overflow
        let [demodulated, plain, own, nlm, albedo, emission] =
            predicted.map(|v| if v.is_nan() { 0.0 } else { v });
        let weight = |v: f32| (MAX_LOG * (v / MAX_LOG).tanh()).exp();
        let [demodulated, plain, own, nlm] = [demodulated, plain, own, nlm].map(weight);
        let sum = demodulated + plain + own + nlm;
        let sigmoid = |v: f32| 1.0 / (1.0 + (-v).exp());
        let [demodulated, plain, nlm] = [demodulated, plain, nlm].map(|weight| weight / sum);
        Self { demodulated, plain, nlm, albedo: sigmoid(albedo), emission: sigmoid(emission) }
    }
}

impl Candidates {
    /// Returns the unfiltered image with its emission.
    pub fn unfiltered(&self) -> DualImage {
        self.with_emission(&self.colour)
    }

    /// Returns the image of `nlm` with its emission.
    pub fn nlm(&self) -> DualImage {
        self.with_emission(&self.nlm)
    }

    fn with_emission(&self, image: &DualImage) -> DualImage {
        let mut image = image.clone();
        if let Some(emission) = &self.emission {
            image.add_scaled(1.0, &emission.light);
        }
        image
    }

    /// Returns the planes to filter: per part (mean and noise) demodulated colour, colour and, if there is any, emission,
    /// 3 each; then the [`divisor`] of each channel, and the coverage by emitters, if there are any.
    pub fn values(&self) -> Planes {
        let colour = &self.colour.mean;
        let (width, height, pixels) = (colour.width(), colour.height(), colour.pixels());
        let count = self.coverage_plane() + usize::from(self.emission.is_some());
        let mut values = Planes::new(width, height, count);
        let mut rest = values.data_mut();
        let mut next = || {
            let (planes, others) = std::mem::take(&mut rest).split_at_mut(3 * pixels);
            rest = others;
            planes
        };
        let emissions = self.emission.as_ref().map(|emission| emission.light.parts());
        for (part, colour) in self.colour.parts().into_iter().enumerate() {
            let demodulated =
                next().par_iter_mut().with_min_len(TASK_PIXELS).zip(colour.data()).zip(self.albedo.data());
            demodulated.for_each(|((out, colour), &albedo)| *out = colour / divisor(albedo));
            next().copy_from_slice(colour.data());
            if let Some(emissions) = emissions {
                next().copy_from_slice(emissions[part].data());
            }
        }
        let divisors = next().iter_mut().zip(self.albedo.data());
        divisors.for_each(|(out, &albedo)| *out = divisor(albedo));
        if let Some(emission) = &self.emission {
            rest.copy_from_slice(emission.coverage.data());
        }
        values
    }

    /// Returns the index of the first plane of the divisor among the values, behind both parts.
    fn divisor_plane(&self) -> usize {
        2 * self.planes_per_part()
    }

    /// Returns the index of the plane of the coverage.
    fn coverage_plane(&self) -> usize {
        self.divisor_plane() + 3
    }

    fn planes_per_part(&self) -> usize {
        if self.emission.is_some() { EMISSION + 3 } else { EMISSION }
    }

    /// Returns for each pixel whether it lies outside all emitters, where it gets none of its neighbours' emission.
    fn outside_emitters(&self) -> Vec<bool> {
        let pixels = 0..self.colour.mean.pixels();
        let met_emitter: Vec<bool> = match &self.emission {
            Some(emission) => pixels.map(|i| (0..3).any(|c| emission.light.mean.plane(c)[i] > 0.0)).collect(),
            None => pixels.map(|_| false).collect(),
        };
        outside_emitters(self.colour.mean.width(), &met_emitter)
    }

    /// Filters the candidates with predicted kernels and mixes them. `hit`: fraction of the samples that hit a surface, extended by
    /// [`MARGIN`].
    pub fn filter_and_mix(&self, predicted: &Prediction, hit: &InterleavedPlanes) -> DualImage {
        let values = InterleavedPlanes::extended(&self.values(), MARGIN);
        let filtered = affinity::filter(|level, out| predicted.kernels(level, out), hit, values);
        self.mix(&predicted.mixture(), &filtered)
    }

    /// Mixes the candidates with the filtered planes of [`Self::values`], and adds the emission.
    fn mix(&self, predicted: &InterleavedPlanes, filtered: &InterleavedPlanes) -> DualImage {
        let (width, height) = (predicted.width(), predicted.height());
        let is_outside = self.outside_emitters();
        let weights: Vec<MixtureWeights> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let predicted = std::array::from_fn(|k| predicted.at(k, i % width, i / width));
                let weights = MixtureWeights::new(predicted);
                let factor = match &self.emission {
                    Some(emission) if !is_outside[i] => {
                        let filtered = |plane: usize| filtered.at(plane, i % width, i / width);
                        let light = [0, 1, 2].map(|channel| filtered(EMISSION + channel));
                        emission.filtered_fraction(i, light, filtered(self.coverage_plane()))
                    }
                    _ => 0.0,
                };
                MixtureWeights { emission: factor * weights.emission, ..weights }
            })
            .collect();
        let [mean, noise] = [0, 1].map(|part| {
            let mut mixed = Planes::new(width, height, 3);
            for (channel, plane) in mixed.planes_mut().enumerate() {
                plane.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
                    self.mix_row(part, channel, y, &weights[y * width..], filtered, out);
                });
            }
            mixed
        });
        DualImage { mean, noise }
    }

    /// Mixes row `y` of a channel of the means (`part` 0) or of the noise (1). `weights` begin at the row.
    fn mix_row<'a>(
        &'a self,
        part: usize,
        channel: usize,
        y: usize,
        weights: &[MixtureWeights],
        filtered: &InterleavedPlanes,
        out: &mut [f32],
    ) {
        // Find the candidates' rows
        let pixels = y * out.len()..(y + 1) * out.len();
        let first = part * self.planes_per_part();
        let own_row = |image: &'a DualImage| &image.parts()[part].plane(channel)[pixels.clone()];
        let colour = own_row(&self.colour);
        let albedo = &self.albedo.plane(channel)[pixels.clone()];
        let (nlm, emission) =
            (own_row(&self.nlm), self.emission.as_ref().map(|emission| own_row(&emission.light)));
        let filtered_row = |plane: usize| filtered.row(plane + channel, y);
        let (demodulated, plain) = (filtered_row(first + DEMODULATED), filtered_row(first + COLOUR));
        let filtered_albedo = filtered_row(self.divisor_plane());
        let filtered_emission = self.emission.as_ref().map(|_| filtered_row(first + EMISSION));

        // Add changes of the pixel's own value, so that a candidate equal to it changes nothing
        for (x, (out, weights)) in out.iter_mut().zip(weights).enumerate() {
            let (own, albedo) = (colour[x], divisor(albedo[x]));
            let textured = demodulated[x] * (albedo + weights.albedo * (filtered_albedo[x] - albedo));
            *out = own
                + weights.demodulated * (textured - own)
                + weights.plain * (plain[x] - own)
                + weights.nlm * (nlm[x] - own);
            if let (Some(own), Some(filtered)) = (emission, filtered_emission) {
                *out += own[x] + weights.emission * (filtered[x] - own[x]);
            }
        }
    }
}

/// Returns the divisor of the colour: the albedo, clamped to [`ALBEDO_RANGE`].
pub fn divisor(albedo: f32) -> f32 {
    let [min, max] = ALBEDO_RANGE;
    albedo.clamp(min, max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_predictions_that_are_no_numbers_are_numbers() {
        for nan in 0..MIXTURE {
            let mut predicted = [0.0; MIXTURE];
            predicted[nan] = f32::NAN;
            let MixtureWeights { demodulated, plain, nlm, albedo, emission } = MixtureWeights::new(predicted);
            assert_eq!([demodulated, plain, nlm, albedo, emission], [0.25, 0.25, 0.25, 0.5, 0.5]);
        }
    }

    #[test]
    fn a_leaf_before_the_sky_keeps_its_own_emission() {
        let planes = |values: [f32; 3], count: usize| {
            let mut planes = Planes::new(3, 1, count);
            planes.planes_mut().for_each(|plane| plane.copy_from_slice(&values));
            planes
        };
        let black = DualImage::exact(planes([0.0; 3], 3));
        let candidates = Candidates {
            colour: black.clone(),
            emission: Some(VisibleEmission {
                light: DualImage::exact(planes([20.0, 0.0, 20.0], 3)),
                coverage: planes([1.0, 0.0, 1.0], 1),
                samples: vec![4.0; 3],
            }),
            albedo: planes([1.0; 3], 3),
            nlm: black,
        };
        // The kernels average all three pixels, and the network takes all of that
        let mut filtered = candidates.values();
        filtered.planes_mut().for_each(|plane| plane.fill(plane.iter().sum::<f32>() / 3.0));
        let [predicted, filtered] = [planes([20.0; 3], MIXTURE), filtered]
            .map(|planes| InterleavedPlanes::from_planes(&planes, 0, 0.0));
        let mixed = candidates.mix(&predicted, &filtered);
        let average = 40.0 / 3.0;
        for (found, expected) in mixed.mean.plane(1).iter().zip([average, average / 81.0, average]) {
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
    }
}
