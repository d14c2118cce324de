//! Filters squares of pixels in place of pixels, with all of their samples: of a store with fewer samples than pixels, or where time is
//! short.
//!
//! Pixels without samples would get those of their neighbours, and a denoiser would take one noisy sample for many that agree. The rule is
//! our own; `docs/method.md` has what it gains.

use std::ops::Range;

use super::common::emitter_outlines::outside_emitters;
use super::common::fireflies::pixel_luminance;
use super::common::hole_filling::filled_means;
use super::denoiser::Denoiser;
use super::denoisers::UNFILTERED;
use super::result::FilterResult;
use crate::image::Planes;
use crate::image::enlargement::smoothed;
use crate::stats::{Block, Rectangle, Store};

/// Least mean number of samples of a square inside the image.
const SQUARE_SAMPLES: f64 = 0.7;

/// Largest mean number of samples of the pixels that have any. Above it pixels were chosen, and stay apart.
const MOST_SAMPLES: f64 = 4.0;

/// Seconds of one core per pixel of the image to pool its first two samples, each, and to enlarge the image of the squares, with
/// memory at hand. Measured on two cores, 512×512 to 1920×1080.
const POOLING_SECONDS: f64 = 0.15e-6;
const ENLARGEMENT_SECONDS: f64 = 0.3e-6;

/// Ratio of the time of a pass over a square to that over a pixel, both with the new memory that they take. Measured on two cores with
/// memory at hand: 0.7 to 1.1 from 512×512 to 1920×1080. Larger images take more of the time than that for writing.
const SQUARE_RATIO: f64 = 1.1;

/// Bytes that the statistics of a square take.
const POOLED_BYTES: f64 = 600.0;

/// Filters squares of `side` pixels of a store; the pixels themselves if it is 1.
pub fn filter(denoiser: &dyn Denoiser, store: &Store, side: usize, seed: u64) -> FilterResult {
    if side == 1 {
        return denoiser.filter(store, seed);
    }
    let pooled = store.pooled(side);
    let result = denoiser.filter(&pooled, seed);
    if result.failure.is_some() {
        return denoiser.filter(store, seed);
    }
    let size = (store.width(), store.height());
    let enlarged = |planes: &Planes| smoothed(planes, side, size);
    let emission =
        store.layout().block(Block::Emission).and_then(|dims| Emission::new(store, &pooled, side, dims));
    let image = |planes: &Planes| match &emission {
        Some(emission) => emission.enlarge(planes, side),
        None => enlarged(planes),
    };
    FilterResult {
        image: image(&result.image),
        halves: result.halves.each_ref().map(image),
        variance: enlarged(&result.variance),
        error: enlarged(&result.error),
        residual: enlarged(&result.residual),
        risk: enlarged(&result.risk),
        ..result
    }
}

/// Returns the side of the squares that a denoiser filters, in pixels: `least_side`, or as large as the samples of a sparse store ask
/// for; 1 if pixels are filtered.
pub fn side(denoiser: &dyn Denoiser, store: &Store, least_side: usize) -> usize {
    let (width, height) = (store.width(), store.height());
    let samples = store.samples_taken() as f64;
    let with_samples = store.pixels() - store.empty_pixels(&Rectangle::whole(width, height));
    let can_filter = denoiser.least_spp() > 0.0 && samples > 0.0;
    let has_chosen = samples > MOST_SAMPLES * with_samples as f64;
    match can_filter {
        true if has_chosen => least_side,
        true => least_side.max(side_for(samples / store.pixels() as f64)),
        false => 1,
    }
}

/// Returns the side of the squares that have enough samples where the image has `spp` per pixel, above 0: 1 if pixels have.
pub fn side_for(spp: f64) -> usize {
    if spp >= 1.0 { 1 } else { ((SQUARE_SAMPLES / spp).sqrt().ceil() as usize).max(2) }
}

/// Returns the seconds of one core per pixel from the start of a pass over squares until the image is written, as
/// [`Cost`](super::Cost) has them for pixels. `spp`: samples per pixel; `memory_seconds`: seconds of one core for a byte of new memory.
pub fn core_seconds(denoiser: &dyn Denoiser, side: usize, spp: f64, memory_seconds: f64) -> f64 {
    let [all, unfiltered] =
        [denoiser, UNFILTERED].map(|denoiser| denoiser.cost().core_seconds_with(memory_seconds));
    if side == 1 {
        return all;
    }
    let of_square = SQUARE_RATIO * (all - unfiltered) + POOLED_BYTES * memory_seconds;
    let squares = of_square / (side * side) as f64;
    unfiltered + spp.min(2.0) * POOLING_SECONDS + squares + ENLARGEMENT_SECONDS
}

/// Directly visible emission. It has little noise and is often far brighter than what is around it, so that pixels keep their own.
struct Emission {
    /// That of the pixels, and of the squares: 3 planes each.
    pixels: Planes,
    squares: Planes,
    /// Weights of the squares' other light, small where emission may have come over an edge, and their sum in each pixel: 1 plane
    /// each.
    weights: Planes,
    sums: Planes,
}

impl Emission {
    /// `dims` are the dimensions of emission in both stores; `None` if no sample met an emitter.
    fn new(store: &Store, pooled: &Store, side: usize, dims: Range<usize>) -> Option<Self> {
        /// Weight at emitters: other squares determine the light beside them, if there are any.
        const AT_EMITTERS: f32 = 1e-3;
        let squares = filled_means(pooled, dims.clone());
        let met_emitter: Vec<bool> =
            (0..squares.pixels()).map(|i| pixel_luminance(&squares, i) > 0.0).collect();
        if !met_emitter.contains(&true) {
            return None;
        }
        let mut weights = Planes::new(squares.width(), squares.height(), 1);
        let outside = outside_emitters(squares.width(), &met_emitter);
        let values = weights.data_mut().iter_mut().zip(outside);
        values.for_each(|(weight, is_outside)| *weight = if is_outside { 1.0 } else { AT_EMITTERS });
        let sums = smoothed(&weights, side, (store.width(), store.height()));
        Some(Self { pixels: filled_means(store, dims), squares, weights, sums })
    }

    /// Enlarges an image of the squares to one of the pixels.
    fn enlarge(&self, image: &Planes, side: usize) -> Planes {
        // Take off the squares' emission
        let mut light = image.clone();
        let values = light.data_mut().iter_mut().zip(self.squares.data());
        values.for_each(|(value, emission)| *value = (*value - emission).max(0.0));
        let mut weighted = light.clone();
        for plane in weighted.planes_mut() {
            plane.iter_mut().zip(self.weights.data()).for_each(|(value, weight)| *value *= weight);
        }

        // Enlarge the rest, and add that of the pixels
        let size = (self.pixels.width(), self.pixels.height());
        let [mut light, weighted] = [light, weighted].map(|planes| smoothed(&planes, side, size));
        for (channel, plane) in light.planes_mut().enumerate() {
            let (emission, weighted) = (self.pixels.plane(channel), weighted.plane(channel));
            for (i, value) in plane.iter_mut().enumerate() {
                let is_dark = pixel_luminance(&self.pixels, i) == 0.0;
                *value = if is_dark { weighted[i] / self.sums.data()[i] } else { *value + emission[i] };
            }
        }
        light
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::filter::{learned, nlm, prpf};
    use crate::stats::Layout;

    /// Returns a store of 64×64 pixels of light 1 with the samples of `count`, one in eight of which has all of it.
    fn rare_light(count: impl Fn(usize, usize) -> u32 + Sync) -> Store {
        let layout = Layout::with_blocks(|_| false);
        store(
            64,
            64,
            layout,
            |x, y| count(x, y) as _,
            |_, _, _, rng| {
                let light = if rng.random_bool(0.125) { 8.0 } else { 0.0 };
                let mut sample = vec![0.0; 5];
                sample[2..].fill(light);
                sample
            },
        )
    }

    #[test]
    fn squares_have_enough_samples() {
        let side_of = |denoiser: &dyn Denoiser, count: &(dyn Fn(usize, usize) -> u32 + Sync)| {
            side(denoiser, &rare_light(count), 1)
        };
        let learned = &learned::DRAFT;
        assert_eq!(side_of(learned, &|_, _| 1), 1);
        assert_eq!(side(learned, &rare_light(|_, _| 8), 3), 3, "time is short");
        assert_eq!(side(UNFILTERED, &rare_light(|_, _| 8), 3), 1);
        assert_eq!(side_of(learned, &|x, _| u32::from(x % 2 == 0)), 2);
        assert_eq!(side_of(learned, &|x, y| u32::from(x % 2 == 0 && y % 4 == 0)), 3);
        assert_eq!(side_of(learned, &|x, y| u32::from(x % 4 == 0 && y % 4 == 0)), 4);
        assert_eq!(side_of(learned, &|_, _| 0), 1, "there is nothing to filter");
        assert_eq!(side_of(learned, &|x, y| if x < 8 && y < 8 { 32 } else { 0 }), 1, "pixels were chosen");
        assert_eq!(
            side_of(&prpf::INTERIM, &|x, _| u32::from(x % 2 == 0)),
            1,
            "squares have no sample vectors"
        );
        assert_eq!(side_of(UNFILTERED, &|x, _| u32::from(x % 2 == 0)), 1);
    }

    #[test]
    fn narrow_images_are_filtered() {
        for (width, height) in [(2, 1), (1, 9), (70, 1), (1, 1)] {
            let layout = Layout::with_blocks(|_| false);
            let sparse = store(width, height, layout, |x, y| u32::from(x + y == 0), |_, _, _, _| [0.5; 5]);
            let image = filter(&learned::DRAFT, &sparse, side(&learned::DRAFT, &sparse, 1), 0).image;
            assert_eq!((image.width(), image.height()), (width, height));
            assert!(image.data().iter().all(|v| (v - 0.5).abs() < 1e-3), "{width}×{height}");
        }
    }

    #[test]
    fn few_samples_of_rare_light_give_an_even_image() {
        let sparse = rare_light(|x, y| u32::from((x + y) % 2 == 0));
        let error = |result: &FilterResult| {
            let squares = result.image.data().iter().map(|v| (v - 1.0).powi(2));
            squares.sum::<f32>() / result.image.data().len() as f32
        };
        for denoiser in [&nlm::DRAFT as &dyn Denoiser, &learned::DRAFT] {
            let (squares, pixels) = (filter(denoiser, &sparse, 2, 0), denoiser.filter(&sparse, 0));
            assert!(error(&squares) < 0.5 * error(&pixels), "{} {}", error(&squares), error(&pixels));
            assert_eq!(squares.made_by, denoiser.name());
            for planes in
                [&squares.image, &squares.variance, &squares.error, &squares.residual, &squares.risk]
            {
                assert_eq!((planes.width(), planes.height()), (64, 64));
            }
        }
    }

    #[test]
    fn a_lamps_light_stays_inside_its_outline() {
        let layout = Layout::with_blocks(|block| matches!(block, Block::Emission | Block::Radiance));
        let is_lamp = |x: usize, y: usize| (20..40).contains(&x) && (20..40).contains(&y);
        let sparse = store(
            64,
            64,
            layout.clone(),
            |x, y| u32::from((x + y) % 2 == 0),
            |x, y, _, rng| {
                let emitted = if is_lamp(x, y) { [100.0; 3] } else { [0.0; 3] };
                let mut sample = wall(&layout, x, y, [1.0; 3], rng);
                layout.write(&mut sample, Block::Emission, &emitted);
                layout.write(&mut sample, Block::Radiance, &emitted.map(|emitted| 1.0 + emitted));
                sample
            },
        );
        let image = filter(&learned::DRAFT, &sparse, side(&learned::DRAFT, &sparse, 1), 0).image;
        for (y, x) in (0..64).flat_map(|y| (0..64).map(move |x| (y, x))) {
            let (found, rim) = (image.at(0, x, y), [19, 20, 39, 40]);
            if !rim.contains(&x) && !rim.contains(&y) {
                let expected = if is_lamp(x, y) { 101.0 } else { 1.0 };
                assert!((found - expected).abs() < 0.1 * expected, "{x} {y}: {found}");
            }
        }
    }

    #[test]
    fn enough_samples_are_filtered_pixel_by_pixel() {
        let full = rare_light(|_, _| 3);
        let side = side(&nlm::DRAFT, &full, 1);
        assert_eq!(filter(&nlm::DRAFT, &full, side, 0).image, nlm::DRAFT.filter(&full, 0).image);
    }
}
