//! Adds back the radiance that was cut off fireflies: to the similar pixels around each of them, or blurred
//! over its surroundings at a cost that does not depend on the number of fireflies.

use rayon::prelude::*;

use super::blur;
use super::fireflies::{Firefly, FireflyClamp, FireflySettings, pixel_luminance};
use crate::image::{Planes, luminance};

/// Fireflies whose weights are in memory at the same time.
const CHUNK: usize = 256;

/// Adds the excess of each firefly to the similar pixels of the window around it, with the weights of a
/// Gaussian of a quarter window. All `images` receive the same radiance; the first one determines the limit.
pub fn redistribute(
    fireflies: &[Firefly],
    images: &mut [&mut Planes],
    settings: &FireflySettings,
    is_similar: impl Fn((usize, usize), (usize, usize)) -> bool + Sync,
) {
    let [image, ..] = images else { return };
    if settings.redistribution_window == 0 {
        return;
    }
    let (width, height) = (image.width(), image.height());
    let limits: Vec<f32> =
        (0..image.pixels()).map(|i| settings.redistribution_limit * pixel_luminance(image, i)).collect();
    let gaussian = gaussian(settings.redistribution_window);

    // Compute the fraction that each pixel receives of a firefly
    let fractions = |firefly: &Firefly| {
        let pixel = (firefly.pixel % width, firefly.pixel / width);
        let (mut fractions, total) = window_weights(pixel, (width, height), &gaussian, &is_similar);
        let excess = luminance(firefly.excess);
        for (pixel, fraction) in &mut fractions {
            *fraction = (*fraction / total).min(limits[*pixel] / excess);
        }
        fractions
    };

    // Add the radiance, in the order of the fireflies
    for chunk in fireflies.chunks(CHUNK) {
        let all: Vec<_> = chunk.par_iter().map(fractions).collect();
        for (firefly, fractions) in chunk.iter().zip(all) {
            for image in images.iter_mut() {
                for (plane, excess) in image.planes_mut().zip(firefly.excess) {
                    fractions.iter().for_each(|&(pixel, fraction)| plane[pixel] += fraction * excess);
                }
            }
        }
    }
}

/// Gaussian of a quarter window, for offsets from 0 to half the window.
fn gaussian(window: usize) -> Vec<f32> {
    let factor = -8.0 / (window * window) as f32;
    (0..=window / 2).map(|d| (factor * (d * d) as f32).exp()).collect()
}

/// Returns the pixels of the window around (x, y) that are similar to it or are the pixel itself, with their
/// weights, and the sum of weights.
fn window_weights(
    (x, y): (usize, usize),
    (width, height): (usize, usize),
    gaussian: &[f32],
    is_similar: &impl Fn((usize, usize), (usize, usize)) -> bool,
) -> (Vec<(usize, f32)>, f32) {
    let radius = gaussian.len() - 1;
    let mut weights = Vec::new();
    let mut total = 0.0;
    for yj in y.saturating_sub(radius)..=(y + radius).min(height - 1) {
        for xj in x.saturating_sub(radius)..=(x + radius).min(width - 1) {
            if (xj, yj) == (x, y) || is_similar((x, y), (xj, yj)) {
                let weight = gaussian[xj.abs_diff(x)] * gaussian[yj.abs_diff(y)];
                total += weight;
                weights.push((yj * width + xj, weight));
            }
        }
    }
    (weights, total)
}

/// Returns the excess of all fireflies, blurred with standard deviation `sigma`: 3 planes to be added to
/// surfaces, or `None` if there are no fireflies. `divisor` is the albedo by which the images are divided, 1
/// if `None`. A pixel receives from a firefly at most `limit` times the firefly's clamped luminance; the rest
/// is dropped.
pub fn blurred_excess(
    clamped: &FireflyClamp,
    divisor: Option<&Planes>,
    sigma: f32,
    limit: f32,
) -> Option<Planes> {
    if clamped.fireflies.is_empty() {
        return None;
    }
    let (width, height) = (clamped.whole.width(), clamped.whole.height());
    let mut excess = Planes::new(width, height, 3);
    for firefly in &clamped.fireflies {
        // Largest value of the blur's kernel
        let peak = 0.5 * std::f32::consts::FRAC_1_PI / (sigma * sigma);
        let most = limit * pixel_luminance(&clamped.whole, firefly.pixel) / peak;
        let fraction = (most / luminance(firefly.excess)).min(1.0);
        for (channel, (plane, value)) in excess.planes_mut().zip(firefly.excess).enumerate() {
            let divisor = divisor.map_or(1.0, |divisor| divisor.plane(channel)[firefly.pixel]);
            plane[firefly.pixel] = fraction * value / divisor;
        }
    }
    for plane in excess.planes_mut() {
        let blurred = blur::gaussian(width, height, plane, sigma);
        plane.copy_from_slice(&blurred);
    }
    Some(excess)
}

#[cfg(test)]
mod tests;
