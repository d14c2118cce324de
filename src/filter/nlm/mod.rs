//! Cross-filtered non-local means (`nlm`): pixel-based and driven by the store like P-RPF, but not the
//! published method.
//!
//! What differs from the paper, each measured as better on path-traced images: each half of the samples is
//! filtered with weights from the other; a patch distance normalised by variance replaces the colour term of
//! Eq. 4 and the weights from mutual information; features are cross-filtered first; the colour is divided by
//! the albedo before the filter and multiplied after it; a local linear fit is a second estimate, and the two
//! are blended by their estimated risk.
//!
//! 1. Fireflies are clamped to the median around them.
//! 2. Albedo and normals are filtered.
//! 3. The colour over the albedo is filtered with weights from colour (patch distance) and normals, and
//!    multiplied by the albedo. Directly visible emission is filtered on its own.
//! 4. Both are blended with a local linear fit (preset `standard` only).
//! 5. The excess of fireflies is redistributed.
//! 6. Image, variance, residual and error follow from the two halves.

mod blend;
mod cross_filtering;
mod layers;
mod local_regression;
mod non_local_means;
mod patch_distance;
mod row_sums;
mod settings;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::common::dual_buffer::DualBuffer;
use super::common::error_maps::{ErrorMaps, FilteredPart};
use super::common::fireflies::FireflyClamp;
use super::common::firefly_redistribution::blurred_excess;
use super::common::half_counts::HalfCounts;
use super::common::linear_estimate::LinearEstimate;
use super::denoiser::{Cost, Denoiser, LayerFilter, PartFilter, Reads, SampleVectors};
use super::denoiser_name::DenoiserName;
use super::result::{FilterResult, Reliability};
use super::whole_image::{self, AllPixels, WholeImage};
use crate::image::Planes;
use crate::stats::{Block, Store};
use blend::{Brightness, blend, fraction_of_first, mix};
use cross_filtering::{filter_colour, filter_emission, filter_feature, fit};
use layers::ColourSteps;
pub use settings::NlmSettings;

/// Non-local means with one of its presets.
pub struct Nlm {
    preset: &'static str,
    summary: &'static str,
    cost: Cost,
    settings: NlmSettings,
}

/// The preset for the final image.
pub static STANDARD: Nlm = Nlm {
    preset: "standard",
    summary: "Cross-filtered non-local means, the default where memory is short",
    cost: Cost { core_seconds: 4.2e-6, bytes: 640, pass_time: 2.6, is_per_sample: false },
    settings: NlmSettings::standard(),
};

/// The preset for interim passes.
pub static DRAFT: Nlm = Nlm {
    preset: "draft",
    summary: "The same with smaller discs and without its linear fit: for passes between batches",
    cost: Cost { core_seconds: 1.9e-6, bytes: 510, pass_time: 1.0, is_per_sample: false },
    settings: NlmSettings::draft(),
};

const METHOD: &str = "nlm";

impl Nlm {
    /// Filters a store, and layers that sum to its colour, without an estimate of the error.
    pub fn images(
        &self,
        store: &Store,
        layers: &[[Planes; 2]],
        whole: &dyn WholeImage,
    ) -> (Images, Vec<Planes>) {
        let (filtered, layers) = FilteredHalves::new(store, &self.settings, layers, whole);
        (filtered.into_images(), layers)
    }
}

impl Denoiser for Nlm {
    fn name(&self) -> DenoiserName {
        DenoiserName { method: METHOD, preset: Some(self.preset) }
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn reads(&self) -> Reads {
        let blocks = &[Block::Colour, Block::Normal1, Block::Albedo, Block::Radiance, Block::Emission];
        Reads { blocks, sample_vectors: SampleVectors::None }
    }

    fn cost(&self) -> Cost {
        self.cost
    }

    fn least_spp(&self) -> f64 {
        // Each half of the samples is filtered by the other, and two single samples tell little of a pixel.
        3.0
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &DRAFT
    }

    fn filter(&self, store: &Store, _: u64) -> FilterResult {
        FilterResult { made_by: self.name(), ..filter(store, &self.settings) }
    }

    fn parts(&self) -> Option<&dyn PartFilter> {
        Some(self)
    }

    fn layers(&self) -> Option<&dyn LayerFilter> {
        Some(self)
    }
}

impl PartFilter for Nlm {
    fn margin(&self) -> usize {
        self.settings.margin()
    }

    fn filter_part(&self, store: &Store, whole: &dyn WholeImage) -> FilterResult {
        let (result, _) = filter_with_layers(store, &self.settings, &[], whole);
        FilterResult { made_by: self.name(), ..result }
    }
}

impl LayerFilter for Nlm {
    fn filter_with_layers(
        &self,
        store: &Store,
        _: u64,
        layers: &[[Planes; 2]],
    ) -> (FilterResult, Vec<Planes>) {
        let whole = AllPixels::new(store.width(), store.height());
        let (result, layers) = filter_with_layers(store, &self.settings, layers, &whole);
        (FilterResult { made_by: self.name(), ..result }, layers)
    }
}

/// Filters a store.
pub fn filter(store: &Store, settings: &NlmSettings) -> FilterResult {
    filter_with_layers(store, settings, &[], &AllPixels::new(store.width(), store.height())).0
}

fn filter_with_layers(
    store: &Store,
    settings: &NlmSettings,
    layers: &[[Planes; 2]],
    whole: &dyn WholeImage,
) -> (FilterResult, Vec<Planes>) {
    let (filtered, layers) = FilteredHalves::new(store, settings, layers, whole);
    let maps = filtered.error_maps();
    let Images { image, halves } = filtered.into_images();
    let made_by = DenoiserName { method: METHOD, preset: None };
    let result = FilterResult::with_maps(made_by, image, halves, maps, Reliability::CROSS_FILTERED);
    (result, layers)
}

/// The filtered image and those of the halves of its samples, emission included: 3 planes each.
pub struct Images {
    pub image: Planes,
    pub halves: [Planes; 2],
}

/// Colour and emission in both halves of the samples, filtered and not.
struct FilteredHalves {
    counts: HalfCounts,
    noisy: DualBuffer,
    colour: [LinearEstimate; 2],
    noisy_emission: Option<DualBuffer>,
    emission: Option<[LinearEstimate; 2]>,
}

impl FilteredHalves {
    /// Filters a store, and layers that sum to its colour.
    fn new(
        store: &Store,
        settings: &NlmSettings,
        layers: &[[Planes; 2]],
        whole: &dyn WholeImage,
    ) -> (Self, Vec<Planes>) {
        let layout = store.layout();
        let counts = HalfCounts::from_store(store);
        let settings =
            &settings.for_samples(whole_image::samples_per_pixel(whole, counts.integers(), store.width()));
        let read = |block| layout.block(block).map(|dims| DualBuffer::from_store(store, dims, &counts));

        // Clamp fireflies and filter the features
        let (noisy, clamped) =
            DualBuffer::from_store_clamped(store, layout.colour(), &counts, &settings.fireflies);
        let normal = read(Block::Normal1).map(|normal| filter_feature(&normal, settings));
        let albedo = read(Block::Albedo)
            .map(|albedo| clamp_albedo(filter_feature(&albedo, settings), settings.albedo_floor));
        let noisy_emission = read(Block::Emission);

        // Filter colour and emission
        let mut colour = filter_colour(&noisy, normal.as_ref(), albedo.as_ref(), settings, whole);
        let mut emission = noisy_emission.as_ref().map(|emission| filter_emission(emission, settings, whole));

        // Blend them with local linear fits
        let mut fraction = None;
        if settings.fit_radius > 0 {
            let mut image = counts.mean([&colour[0].value, &colour[1].value]);
            if let Some([a, b]) = &emission {
                add(&mut image, &counts.mean([&a.value, &b.value]));
            }
            let parts = colour.iter().chain(emission.iter().flatten()).map(|half| &half.value);
            let brightness = Brightness::new(&image, parts, whole);
            let features = [normal.as_ref(), albedo.as_ref()];
            let fitted = fit(&noisy, features, settings.fit_k, settings, whole);
            let of_first = fraction_of_first(&noisy, &brightness, &colour, &fitted, settings.blend_sigma);
            colour = mix(colour, &fitted, &of_first);
            fraction = Some(of_first);
            emission = emission.zip(noisy_emission.as_ref()).map(|(emission, noisy)| {
                let fitted = fit(noisy, [None; 2], settings.fit_emission_k, settings, whole);
                blend(noisy, &brightness, emission, &fitted, settings.blend_sigma)
            });
        }
        add_firefly_excess(&mut colour, &clamped, normal.as_ref(), albedo.as_ref(), settings);
        let steps = ColourSteps {
            noisy: &noisy,
            counts: &counts,
            fireflies: &clamped.fireflies,
            features: [normal.as_ref(), albedo.as_ref()],
            fraction: fraction.as_deref(),
            settings,
            whole,
        };
        let layers = steps.filter(layers, colour.each_ref().map(|half| &half.value));
        (Self { counts, noisy, colour, noisy_emission, emission }, layers)
    }

    /// Estimates the error of the sum of colour and emission.
    fn error_maps(&self) -> ErrorMaps {
        let part = |noisy, filtered| FilteredPart { noisy, filtered };
        let emission = self.noisy_emission.as_ref().zip(self.emission.as_ref());
        let emission = emission.map(|(noisy, emission)| part(noisy, emission));
        ErrorMaps::cross_filtered(part(&self.noisy, &self.colour), emission, &self.counts)
    }

    /// Adds the emission to the colour.
    fn into_images(self) -> Images {
        let mut halves = self.colour.map(|half| half.value);
        for (half, emission) in halves.iter_mut().zip(self.emission.iter().flatten()) {
            add(half, &emission.value);
        }
        Images { image: self.counts.mean([&halves[0], &halves[1]]), halves }
    }
}

/// Adds the blurred excess of fireflies to surfaces, multiplied by the albedo.
fn add_firefly_excess(
    colour: &mut [LinearEstimate; 2],
    clamped: &FireflyClamp,
    normal: Option<&[Planes; 2]>,
    albedo: Option<&[Planes; 2]>,
    settings: &NlmSettings,
) {
    // Each half is divided by the albedo of its guide, the other half.
    let guide_albedo = albedo.map(|[a, b]| [b, a]);
    let divisor = guide_albedo.map(|[divisor, _]| divisor);
    let Some(excess) = blurred_excess(clamped, divisor, settings.firefly_sigma, settings.firefly_limit)
    else {
        return;
    };
    let surface: Vec<bool> = (0..excess.pixels()).into_par_iter().map(|i| is_surface(normal, i)).collect();
    for (h, half) in colour.iter_mut().enumerate() {
        for (channel, plane) in half.value.planes_mut().enumerate() {
            let albedo = guide_albedo.map(|albedo| albedo[h].plane(channel));
            let excess = excess.plane(channel);
            for i in (0..plane.len()).filter(|&i| surface[i]) {
                plane[i] += excess[i] * albedo.map_or(1.0, |albedo| albedo[i]);
            }
        }
    }
}

/// Whether samples of a pixel hit a surface, which its normal shows. Without normals all pixels count as surfaces.
fn is_surface(normal: Option<&[Planes; 2]>, i: usize) -> bool {
    /// Minimum squared length of the mean normal of a surface. The filter may spread a trace of the
    /// neighbours' normals.
    const MIN_SQUARED_LENGTH: f32 = 1e-4;
    normal.is_none_or(|halves| {
        let is_long =
            |half: &Planes| (0..3).map(|c| half.plane(c)[i].powi(2)).sum::<f32>() > MIN_SQUARED_LENGTH;
        halves.iter().any(is_long)
    })
}

fn add(sum: &mut Planes, term: &Planes) {
    sum.data_mut().iter_mut().zip(term.data()).for_each(|(sum, &v)| *sum += v);
}

/// Clamps albedos to a range that is safe to divide by. The maximum, which no surface reaches, keeps squares
/// of the brightest colours finite.
fn clamp_albedo(mut halves: [Planes; 2], floor: f32) -> [Planes; 2] {
    const MAX_ALBEDO: f32 = 64.0;
    halves.iter_mut().flat_map(Planes::data_mut).for_each(|v| *v = v.clamp(floor, MAX_ALBEDO));
    halves
}
