//! Intel Open Image Denoise, loaded if it is installed: an alternative denoiser, and a baseline for the others.
//!
//! The library gets the mean of the samples, albedo and normals. It is a network that adds what it has learnt to the
//! image, not a linear filter of the samples, so that variance and error are those of its results on the two halves.
//!
//! 1. Albedo and normals are filtered (preset `standard` only).
//! 2. The mean of all samples and those of both halves are filtered with them as guides.
//! 3. Variance, residual and error follow from the three images.

mod library;

use super::common::half_counts::HalfCounts;
use super::common::hole_filling::filled_means;
use super::denoiser::{Cost, Denoiser, Reads, SampleVectors};
use super::denoiser_name::DenoiserName;
use super::none::unfiltered;
use super::result::{FilterResult, Reliability};
use crate::image::Planes;
use crate::stats::{Block, Part, Store};
use library::{Device, Interleaved, Quality};

/// Open Image Denoise with one of its presets.
pub struct Oidn {
    preset: &'static str,
    summary: &'static str,
    cost: Cost,
    quality: Quality,
}

/// Its best quality, with filtered guides.
pub static STANDARD: Oidn = Oidn {
    preset: "standard",
    summary: "Intel Open Image Denoise, if it is installed",
    cost: Cost { core_seconds: 33.2e-6, bytes: 900, pass_time: 22.0, is_per_sample: false },
    quality: Quality::High,
};

/// Its fast quality, for passes between batches.
pub static DRAFT: Oidn = Oidn {
    preset: "draft",
    summary: "The same in its fast quality: for passes between batches",
    cost: Cost { core_seconds: 5.2e-6, bytes: 900, pass_time: 4.1, is_per_sample: false },
    quality: Quality::Fast,
};

impl Denoiser for Oidn {
    fn name(&self) -> DenoiserName {
        DenoiserName { method: "oidn", preset: Some(self.preset) }
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn reads(&self) -> Reads {
        let blocks = &[Block::Colour, Block::Normal1, Block::Albedo, Block::Radiance];
        Reads { blocks, sample_vectors: SampleVectors::None }
    }

    fn cost(&self) -> Cost {
        self.cost
    }

    fn least_spp(&self) -> f64 {
        1.0
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &DRAFT
    }

    fn missing(&self) -> Option<&'static str> {
        library::missing()
    }

    fn is_judged_by_halves(&self) -> bool {
        true
    }

    /// If the library fails the image is unfiltered, and says so.
    fn filter(&self, store: &Store, _: u64) -> FilterResult {
        filter(store, self.name(), self.quality)
            .unwrap_or_else(|failure| FilterResult { failure: Some(failure), ..unfiltered(store) })
    }
}

/// Filters a store.
fn filter(store: &Store, made_by: DenoiserName, quality: Quality) -> Result<FilterResult, String> {
    let device = Device::new()?;
    let radiance = store.layout().radiance();
    let mut halves = [0, 1].map(|half| store.means(Part::Half(half), radiance.clone()));
    let counts = HalfCounts::from_store(store);
    counts.fill_missing(&mut halves);

    // Filter the guides; normals need an albedo beside them
    let layout = store.layout();
    let albedo =
        layout.block(Block::Albedo).map(|dims| Interleaved::new(&filled_means(store, dims), 0.0, 1.0));
    let normal =
        layout.block(Block::Normal1).map(|dims| Interleaved::new(&filled_means(store, dims), -1.0, 1.0));
    let are_clean = quality == Quality::High;
    let mut guides = Vec::new();
    for (name, guide) in [(c"albedo", albedo), (c"normal", normal)] {
        let Some(guide) = guide else { break };
        let guide = if are_clean { device.filter(name, &guide, &[], quality, false)? } else { guide };
        guides.push((name, guide));
    }
    let guides: Vec<_> = guides.iter().map(|(name, guide)| (*name, guide)).collect();

    // Filter the image and both halves
    let filter = |noisy: &Planes| -> Result<Planes, String> {
        let noisy = Interleaved::new(noisy, 0.0, f32::MAX);
        let filtered = device.filter(c"color", &noisy, &guides, quality, are_clean && !guides.is_empty())?;
        Ok(filtered.to_planes())
    };
    let image = filter(&filled_means(store, radiance))?;
    let [a, b] = halves.each_ref().map(filter);
    let halves = around(&image, [a?, b?], &counts);
    Ok(FilterResult::self_filtered(made_by, store, image, halves, Reliability::SELF_FILTERED))
}

/// Shifts both halves by the same, so that their mean is the image. A network does not filter the mean of two images to
/// the mean of the filtered ones.
fn around(image: &Planes, halves: [Planes; 2], counts: &HalfCounts) -> [Planes; 2] {
    let mean = counts.mean([&halves[0], &halves[1]]);
    halves.map(|mut half| {
        let values = half.data_mut().iter_mut().zip(image.data()).zip(mean.data());
        values.for_each(|((half, &image), &mean)| *half += image - mean);
        half
    })
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::Layout;

    #[test]
    fn the_halves_lie_around_the_image() {
        let planes = |value: f32| {
            let mut planes = Planes::new(2, 1, 3);
            planes.data_mut().fill(value);
            planes
        };
        let counts = HalfCounts::new(2, [vec![1, 2], vec![3, 2]]);
        let [a, b] = around(&planes(5.0), [planes(1.0), planes(2.0)], &counts);
        assert_eq!((a.at(0, 0, 0), b.at(0, 0, 0)), (4.25, 5.25));
        assert_eq!((a.at(2, 1, 0), b.at(2, 1, 0)), (4.5, 5.5));
    }

    #[test]
    fn noise_on_a_wall_is_removed() {
        if let Some(reason) = STANDARD.missing() {
            println!("skipped: {reason}");
            return;
        }
        let layout = Layout::with_blocks(|block| matches!(block, Block::Albedo | Block::Normal1));
        let noisy = store(
            64,
            48,
            layout.clone(),
            |_, _| 8,
            |x, y, _, rng| {
                let light = 2.0 * rng.random::<f32>();
                wall(&layout, x, y, [light, light, light], rng)
            },
        );
        for denoiser in [&STANDARD, &DRAFT] {
            let result = denoiser.filter(&noisy, 0);
            assert_eq!((result.made_by, result.failure), (denoiser.name(), None));
            let deviation = |image: &Planes| {
                let plane = image.plane(1);
                let squares: f32 = plane.iter().map(|v| (v - 1.0).powi(2)).sum();
                (squares / plane.len() as f32).sqrt()
            };
            let noise = deviation(&store_mean(&noisy));
            assert!(deviation(&result.image) < 0.3 * noise, "{} of {noise}", deviation(&result.image));
            assert!(result.variance.data().iter().all(|v| v.is_finite()));
        }
    }

    fn store_mean(store: &Store) -> Planes {
        store.means(Part::Whole, store.layout().radiance())
    }
}
