//! The learned filter: a small network predicts, from the statistics of the samples, the kernels of an edge-avoiding filter
//! and how its results are mixed with the image of `nlm`.
//!
//! Given the weights, which follow from the statistics of all samples, the filter is linear in their values. It was trained on random
//! scenes (`training/`).
//!
//! 1. The image of `nlm` is made, and single fireflies are clamped.
//! 2. The network predicts kernels and weights of the mixture from the statistics.
//! 3. Colour, with and without the albedo, and directly visible emission are filtered, level by level.
//! 4. The results, the unfiltered image and that of `nlm` are mixed.
//! 5. Where the samples contradict the result, it is blended with the image of `nlm`.
//! 6. Fireflies that are left are dimmed.
//! 7. Light that was lost over a wide surrounding is given back.
//! 8. Layers that sum to the colour are filtered with the same weights.
//! 9. Variance, residual and error follow from the halves, which are filtered with the same weights.

mod affinity;
mod block_convolution;
mod brightness;
mod convolution;
mod dual_image;
mod input_statistics;
mod layers;
mod mixture;
mod network;
mod residual_fireflies;
mod safeguard;
mod visible_emission;
mod weight_file;
mod weights;

use super::common::blur;
use super::common::error_maps::ERROR_SIGMA;
use super::common::fireflies::{self, FireflySettings};
use super::common::half_counts::HalfCounts;
use super::common::interleaved_planes::InterleavedPlanes;
use super::denoiser::{Cost, Denoiser, LayerFilter, PartFilter, Reads, SampleVectors};
use super::denoiser_name::DenoiserName;
use super::nlm::{self, Nlm};
use super::result::{FilterResult, Reliability};
use super::whole_image::{AllPixels, WholeImage};
use crate::image::Planes;
use crate::stats::{Block, Part, Store};
use affinity::MARGIN;
use dual_image::DualImage;
use input_statistics::{ALIGNMENT, InputStatistics};
use layers::ColourSteps;
use mixture::Candidates;
use visible_emission::VisibleEmission;
pub use weight_file::WeightFileError;
use weights::weights;
pub use weights::{use_weights, weights_id};

/// The learned filter with one of its presets.
pub struct Learned {
    preset: &'static str,
    summary: &'static str,
    cost: Cost,
    /// Makes the image that is one of the candidates.
    nlm: &'static Nlm,
}

/// The preset for the final image.
pub static STANDARD: Learned = Learned {
    preset: "standard",
    summary: "Kernels that a small network predicts, mixed with nlm",
    cost: Cost { core_seconds: 6.2e-6, bytes: 700, pass_time: 4.7, is_per_sample: false },
    nlm: &nlm::STANDARD,
};

/// The faster preset.
pub static DRAFT: Learned = Learned {
    preset: "draft",
    summary: "The same, mixed with the preset draft of nlm: faster",
    cost: Cost { core_seconds: 4.1e-6, bytes: 700, pass_time: 2.7, is_per_sample: false },
    nlm: &nlm::DRAFT,
};

const METHOD: &str = "learned";

impl Denoiser for Learned {
    fn name(&self) -> DenoiserName {
        DenoiserName { method: METHOD, preset: Some(self.preset) }
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn reads(&self) -> Reads {
        let blocks = &[
            Block::Colour,
            Block::Position1,
            Block::Normal1,
            Block::Albedo,
            Block::Normal2,
            Block::Radiance,
            Block::Emission,
            Block::Hit,
        ];
        Reads { blocks, sample_vectors: SampleVectors::None }
    }

    fn cost(&self) -> Cost {
        self.cost
    }

    fn least_spp(&self) -> f64 {
        1.0
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        // Less than the time of the network alone, and its maps place the samples as well or better.
        &nlm::DRAFT
    }

    fn weights(&self) -> Option<&'static str> {
        Some(weights_id())
    }

    fn is_judged_by_halves(&self) -> bool {
        true
    }

    fn filter(&self, store: &Store, seed: u64) -> FilterResult {
        self.filter_with_layers(store, seed, &[]).0
    }

    fn parts(&self) -> Option<&dyn PartFilter> {
        Some(self)
    }

    fn layers(&self) -> Option<&dyn LayerFilter> {
        Some(self)
    }
}

impl PartFilter for Learned {
    fn margin(&self) -> usize {
        // Margins are completed between the steps, which all read values with clamped fireflies
        let scale_and_error = brightness::reach() + residual_fireflies::REACH + blur::reach(ERROR_SIGMA);
        let kernels: usize = affinity::DILATIONS.iter().sum();
        let steps = [kernels, network::REACH, safeguard::reach(), scale_and_error];
        let widest = steps.into_iter().fold(0, usize::max) + fireflies::REACH;
        widest.max(self.nlm.margin()).next_multiple_of(ALIGNMENT)
    }

    fn filter_part(&self, store: &Store, whole: &dyn WholeImage) -> FilterResult {
        let (nlm, _) = self.nlm.images(store, &[], whole);
        filter(self.name(), store, nlm, std::iter::empty(), whole).0
    }
}

impl LayerFilter for Learned {
    fn filter_with_layers(
        &self,
        store: &Store,
        _: u64,
        layers: &[[Planes; 2]],
    ) -> (FilterResult, Vec<Planes>) {
        let whole = AllPixels::new(store.width(), store.height());
        let (nlm, of_layers) = self.nlm.images(store, layers, &whole);
        let layers = layers.iter().cloned().zip(of_layers);
        filter(self.name(), store, nlm, layers, &whole)
    }
}

/// The network was trained on rare light as it is, and clamping would darken it. But a single sample does not tell how bright its
/// surroundings are.
const FIREFLIES: FireflySettings =
    FireflySettings { median_factor: 7.0, max_neighbours: Some(1), ..FireflySettings::DEFAULT };

/// Filters a store, and layers that sum to its colour. `nlm` are the images of that denoiser, as is the second value of a
/// layer.
fn filter(
    made_by: DenoiserName,
    store: &Store,
    mut nlm: nlm::Images,
    layers: impl Iterator<Item = ([Planes; 2], Planes)>,
    whole: &dyn WholeImage,
) -> (FilterResult, Vec<Planes>) {
    let (width, height) = (store.width(), store.height());
    let counts = HalfCounts::from_store(store);
    let [a, b] = [0, 1].map(|half| store.means(Part::Half(half), store.layout().colour()));
    let clamped = fireflies::clamp(&counts.mean([&a, &b]), [&a, &b], counts.integers(), &FIREFLIES);
    let statistics = InputStatistics::from_store(store, &counts, &clamped, whole);
    let [a, b] = &mut nlm.halves;
    [&mut nlm.image, a, b].into_iter().for_each(|planes| whole.complete_margin(planes, 1));
    let candidates = candidates(store, &counts, &statistics, clamped.halves, nlm);

    // Filter the image
    let mut predicted = weights().network.predict(statistics.inputs(&candidates.nlm.mean), width, height);
    predicted.complete_margin(whole);
    let hit = InterleavedPlanes::extended(&statistics.hit, MARGIN);
    let mut mixed = candidates.filter_and_mix(&predicted, &hit);
    mixed.complete_margin(whole);
    let unfiltered_image = candidates.unfiltered();
    let nlm = candidates.nlm();
    let emission = candidates.emission.as_ref().map(|emission| &emission.light);
    let fraction = safeguard::fraction_of_learned(&mixed, &nlm, &unfiltered_image, emission, &counts, whole);
    safeguard::blend(&mut mixed, &nlm, &fraction);
    mixed.complete_margin(whole);
    let mut factors = residual_fireflies::factors(&mixed.mean, &statistics);
    mixed.scale(&factors);
    let of_brightness = brightness::factors(&mixed, &unfiltered_image, &counts);
    mixed.scale(&of_brightness);
    factors.iter_mut().zip(&of_brightness).for_each(|(factor, of_brightness)| *factor *= of_brightness);

    // Filter the layers
    let steps = ColourSteps {
        counts: &counts,
        fireflies: &clamped.fireflies,
        albedo: &candidates.albedo,
        predicted: &predicted,
        hit: &hit,
        fraction: &fraction,
        factors: &factors,
    };
    let layers = layers.map(|(layer, nlm)| steps.filter(layer, nlm)).collect();
    let halves = mixed.halves(&counts);
    (FilterResult::self_filtered(made_by, store, mixed.mean, halves, Reliability::LEARNED), layers)
}

/// Collects what is filtered and mixed.
fn candidates(
    store: &Store,
    counts: &HalfCounts,
    statistics: &InputStatistics,
    clamped: [Planes; 2],
    nlm: nlm::Images,
) -> Candidates {
    let layout = store.layout();
    let noisy = |mean: &Planes, halves| DualImage::new(mean.clone(), halves, counts);
    let emission =
        layout.block(Block::Emission).filter(|_| statistics.emission.data().iter().any(|&v| v > 0.0));
    let emission = emission.map(|dims| VisibleEmission::new(store, dims, &statistics.emission, counts));
    let mut nlm = DualImage::new(nlm.image, nlm.halves, counts);
    if let Some(emission) = &emission {
        nlm.add_scaled(-1.0, &emission.light);
    }
    let colour = noisy(&statistics.colour, clamped);
    Candidates { colour, emission, albedo: statistics.albedo.mean.clone(), nlm }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use safetensors::SafeTensors;

    use super::input_statistics::FeatureMoments;
    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::Layout;

    /// Planes of the file that `training/export.py` writes with the weights.
    fn exported(name: &str) -> Planes {
        let file = SafeTensors::deserialize(include_bytes!("parity.safetensors")).unwrap();
        let tensor = file.tensor(name).unwrap();
        let &[count, height, width] = tensor.shape() else { panic!("three dimensions") };
        let mut planes = Planes::new(width, height, count);
        let (values, _) = tensor.data().as_chunks();
        let values = values.iter().map(|&bytes| f32::from_le_bytes(bytes));
        planes.data_mut().iter_mut().zip(values).for_each(|(out, value)| *out = value);
        planes
    }

    #[test]
    fn the_image_is_that_of_the_training_program() {
        let plane = |name| exported(name).plane(0).to_vec();
        let feature = |mean, deviation| FeatureMoments { mean: exported(mean), deviation: plane(deviation) };
        let statistics = InputStatistics {
            scale: 1.0,
            colour: exported("colour"),
            deviation: plane("deviation"),
            difference: plane("difference"),
            emission: exported("emission"),
            albedo: feature("albedo", "albedo_deviation"),
            normal: feature("normal", "normal_deviation"),
            second_normal: exported("second_normal"),
            position_deviation: plane("position_deviation"),
            hit: exported("hit"),
            count: plane("count"),
        };
        let noisy = |mean: &Planes| DualImage { mean: mean.clone(), noise: mean.clone() };
        let mut nlm = noisy(&exported("nlm"));
        nlm.add_scaled(-1.0, &noisy(&statistics.emission));
        let candidates = Candidates {
            colour: noisy(&statistics.colour),
            // The training program does not know the coverage
            emission: Some(VisibleEmission {
                light: noisy(&statistics.emission),
                coverage: Planes::new(statistics.emission.width(), statistics.emission.height(), 1),
                samples: vec![0.0; statistics.emission.pixels()],
            }),
            albedo: statistics.albedo.mean.clone(),
            nlm,
        };
        let inputs = statistics.inputs(&candidates.nlm.mean);
        let expected = exported("mixed");
        let predicted = weights().network.predict(inputs, expected.width(), expected.height());
        let hit = InterleavedPlanes::extended(&statistics.hit, MARGIN);
        let mixed = candidates.filter_and_mix(&predicted, &hit);
        for image in [&mixed.mean, &mixed.noise] {
            for (found, expected) in image.data().iter().zip(expected.data()) {
                assert!((found - expected).abs() < 1e-3 * (1.0 + expected), "{found} {expected}");
            }
        }
    }

    #[test]
    fn noise_on_a_wall_is_removed_and_a_constant_is_exact() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Normal1));
        for is_noisy in [true, false] {
            let store = store(
                49,
                38,
                layout.clone(),
                |_, _| 8,
                |x, y, _, rng| {
                    let light = if is_noisy { 2.0 * rng.random::<f32>() } else { 1.0 };
                    wall(&layout, x, y, [light; 3], rng)
                },
            );
            let noise = deviation(&store.means(Part::Whole, layout.colour()));
            for denoiser in [&STANDARD, &DRAFT] {
                let result = denoiser.filter(&store, 0);
                assert_eq!(result.made_by, denoiser.name());
                assert!(deviation(&result.image) <= 0.3 * noise, "{} of {noise}", deviation(&result.image));
                assert!(is_noisy || result.variance.data().iter().all(|&v| v == 0.0));
            }
        }
    }

    #[test]
    fn a_bright_emitter_does_not_light_the_wall_beside_it() {
        // One of 16 samples of the rim, column 20, meets the emitter
        let (wall_radiance, emitted) = (0.03, 2000.0);
        let layout = Layout::with_blocks(|block| {
            matches!(block, Block::Albedo | Block::Normal1 | Block::Radiance | Block::Emission)
        });
        let meets_emitter = |x: usize, index: u32| x > 20 || x == 20 && index % 16 == 5;
        let sample = |x: usize, y: usize, index: u32, rng: &mut rand_pcg::Pcg32| {
            let mut sample = wall(&layout, x, y, [wall_radiance; 3], rng);
            if meets_emitter(x, index) {
                layout.write(&mut sample, Block::Radiance, &[wall_radiance + emitted; 3]);
                layout.write(&mut sample, Block::Emission, &[emitted; 3]);
            }
            sample
        };
        let store = store(40, 20, layout.clone(), |_, _| 16, sample);
        for denoiser in [&STANDARD, &DRAFT] {
            let image = denoiser.filter(&store, 0).image;
            for (x, y) in (0..20).flat_map(|y| (0..20).map(move |x| (x, y))) {
                assert!((0.02..0.04).contains(&image.at(0, x, y)), "{x} {y}: {}", image.at(0, x, y));
            }
            assert!(image.at(0, 30, 10) > 0.9 * emitted);
        }
    }

    /// Root of the mean squared deviation from 1.
    fn deviation(image: &Planes) -> f32 {
        let squares: f32 = image.data().iter().map(|v| (v - 1.0).powi(2)).sum();
        (squares / image.data().len() as f32).sqrt()
    }

    #[test]
    fn the_image_is_the_mean_of_its_halves_by_sample_counts() {
        let layout = Layout::with_blocks(|_| false);
        let noisy = store(
            20,
            20,
            layout.clone(),
            |x, y| [1, 2, 5, 16][(x + y) % 4],
            |_, _, _, rng| {
                let mut sample = vec![0.0; layout.len()];
                layout.write(&mut sample, Block::Colour, &[0; 3].map(|_| rng.random::<f32>()));
                sample
            },
        );
        let FilterResult { image, halves: [a, b], .. } = DRAFT.filter(&noisy, 0);
        let counts = HalfCounts::from_store(&noisy);
        let mean = counts.mean([&a, &b]);
        for (image, mean) in image.data().iter().zip(mean.data()) {
            assert!((image - mean).abs() < 1e-5, "{image} {mean}");
        }
    }
}
