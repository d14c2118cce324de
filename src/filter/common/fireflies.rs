//! Detects and clamps fireflies: pixels far brighter than their surroundings because of one sample of rare light.
//!
//! Takes the mean colours of all samples and of each half. A pixel is a firefly if its luminance exceeds a
//! bound from the median of 5×5 pixels and one half of its samples holds most of it. Returns the clamped
//! colours and, for each firefly, the radiance that was cut off, which
//! [`firefly_redistribution`](super::firefly_redistribution) adds back.
//!
//! It takes the place of RPF's spike step (Sen and Darabi 2012, section 5), which works on the samples of a
//! pixel after each pass; after the first pass of the pixel-based method there are none.

use rayon::prelude::*;

use crate::image::{Planes, luminance};
use crate::simd::{apply, multiversioned};

/// Constants of firefly detection and redistribution.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct FireflySettings {
    /// The bound on luminance is this factor times the median of 5×5 pixels …
    pub median_factor: f32,
    /// … plus this factor times their standard deviation (1.48 median absolute deviations).
    pub deviation_factor: f32,
    /// Whether fireflies are clamped to the median instead of the bound, which leaves nothing to blur into a spot.
    pub clamp_to_median: bool,
    /// Minimum fraction of a firefly's luminance in one half of the samples. Light in both halves is no accident.
    pub half_fraction: f32,
    /// A firefly is left as it is if more others than this lie within 8 pixels: light that many pixels meet
    /// is no accident. `None` clamps all.
    pub max_neighbours: Option<usize>,
    /// Size of the window over which the excess is redistributed, in pixels; 0 drops it.
    pub redistribution_window: usize,
    /// Maximum luminance that a pixel receives from one firefly, relative to its own. The rest is dropped: it
    /// would show as a halo.
    pub redistribution_limit: f32,
}

impl Default for FireflySettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl FireflySettings {
    /// See [`Default`].
    pub const DEFAULT: Self = Self {
        median_factor: 8.0,
        deviation_factor: 4.0,
        clamp_to_median: false,
        half_fraction: 0.8,
        max_neighbours: None,
        redistribution_window: 17,
        redistribution_limit: 0.02,
    };

    /// Settings that clamp nothing.
    pub fn off() -> Self {
        Self { median_factor: f32::INFINITY, redistribution_window: 0, ..Self::default() }
    }
}

/// Radius of the window of a pixel's bound, in pixels.
const RADIUS: usize = 2;

/// Radius of the window in which fireflies have neighbours, in pixels.
const NEIGHBOUR_RADIUS: usize = 8;

/// Distance in pixels from which pixels can change whether one is clamped.
pub const REACH: usize = RADIUS + NEIGHBOUR_RADIUS;

/// Colours with clamped fireflies.
#[derive(Clone, Debug)]
pub struct FireflyClamp {
    /// Mean colour of all samples: 3 planes.
    pub whole: Planes,
    /// Mean colour of each half of the samples: 3 planes.
    pub halves: [Planes; 2],
    pub fireflies: Vec<Firefly>,
}

/// A clamped firefly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Firefly {
    /// Index of the pixel in a plane.
    pub pixel: usize,
    /// Difference of the mean of all samples before and after clamping.
    pub excess: [f32; 3],
    /// Ratio of the luminance after and before clamping, in (0, 1).
    pub scale: f32,
    /// The same of each half of the samples, in (0, 1].
    pub half_scales: [f32; 2],
}

/// Clamps a layer of the colour, its means in both halves, as the colour was clamped.
pub fn clamp_layer(layer: &mut [Planes; 2], fireflies: &[Firefly]) {
    for firefly in fireflies {
        for (half, scale) in layer.iter_mut().zip(firefly.half_scales) {
            half.planes_mut().for_each(|plane| plane[firefly.pixel] *= scale);
        }
    }
}

/// Clamps fireflies. `whole` and `halves` are means of 3 planes, `counts` the sample counts of the halves.
pub fn clamp(
    whole: &Planes,
    halves: [&Planes; 2],
    counts: [&[u32]; 2],
    settings: &FireflySettings,
) -> FireflyClamp {
    // Find the fireflies
    let (width, height) = (whole.width(), whole.height());
    let luminances: Vec<f32> =
        (0..whole.pixels()).into_par_iter().map(|i| pixel_luminance(whole, i)).collect();
    let mut bounds = vec![None; whole.pixels()];
    bounds.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, bounds)| {
        let is_bright = exceed_most(&luminances, width, y, settings.median_factor);
        for (x, limit) in bounds.iter_mut().enumerate().filter(|(x, _)| is_bright[*x]) {
            let i = y * width + x;
            let [a, b] = [0, 1].map(|h| pixel_luminance(halves[h], i) * counts[h][i] as f32);
            if a.max(b) > settings.half_fraction * (a + b) {
                let is_known = |i: usize| counts[0][i] > 0 || counts[1][i] > 0;
                *limit = bound(&luminances, is_known, (x, y), (width, height), settings);
            }
        }
    });
    let bounds = match settings.max_neighbours {
        Some(max) => lonely(&bounds, (width, height), max),
        None => bounds,
    };

    // Clamp the halves; the whole is their mean
    let mut clamped =
        FireflyClamp { whole: whole.clone(), halves: halves.map(Planes::clone), fireflies: Vec::new() };
    for (pixel, bound) in bounds.iter().enumerate() {
        let Some(bound) = *bound else { continue };
        let half_scales = clamped.halves.each_mut().map(|half| {
            let scale = (bound / pixel_luminance(half, pixel).max(bound)).min(1.0);
            half.planes_mut().for_each(|plane| plane[pixel] *= scale);
            scale
        });
        let [n_a, n_b] = counts.map(|counts| counts[pixel] as f32);
        let mut excess = [0.0; 3];
        for (k, excess) in excess.iter_mut().enumerate() {
            let [a, b] = [0, 1].map(|h| clamped.halves[h].plane(k)[pixel]);
            let value = &mut clamped.whole.plane_mut(k)[pixel];
            let mean = (n_a * a + n_b * b) / (n_a + n_b);
            *excess = *value - mean;
            *value = mean;
        }
        let scale = pixel_luminance(&clamped.whole, pixel) / luminances[pixel];
        clamped.fireflies.push(Firefly { pixel, excess, scale, half_scales });
    }
    clamped
}

/// Returns the bounds of fireflies with at most `max` others in their surroundings.
fn lonely(bounds: &[Option<f32>], (width, height): (usize, usize), max: usize) -> Vec<Option<f32>> {
    let is_lonely = |i: usize| {
        let window = |at: usize, size: usize| {
            at.saturating_sub(NEIGHBOUR_RADIUS)..(at + NEIGHBOUR_RADIUS + 1).min(size)
        };
        let columns = window(i % width, width);
        let in_row = |y: usize| bounds[y * width..][columns.clone()].iter().flatten().count();
        window(i / width, height).map(in_row).sum::<usize>() <= max + 1
    };
    (0..bounds.len()).into_par_iter().map(|i| bounds[i].filter(|_| is_lonely(i))).collect()
}

/// Returns for each pixel of row `y` whether it exceeds `factor` times most luminances of its window, where those without samples are 0.
/// At most pixels it does not: the median is too large for any deviation.
fn exceed_most(luminances: &[f32], width: usize, y: usize, factor: f32) -> Vec<bool> {
    let low: Vec<f32> = luminances[y * width..][..width].iter().map(|own| own / factor).collect();
    let rows = luminances.chunks_exact(width).take(y + RADIUS + 1).skip(y.saturating_sub(RADIUS));
    let mut darker = vec![0_i32; width];
    for row in rows.clone() {
        for (left, right) in (0..=RADIUS).map(|shift| (0, shift)).chain((1..=RADIUS).map(|shift| (shift, 0)))
        {
            let (left, right) = (left.min(width), right.min(width));
            let inside = width - left.max(right);
            count_darker(&low[left..][..inside], &row[right..][..inside], &mut darker[left..][..inside]);
        }
    }
    let is_most = |(x, darker): (usize, &i32)| {
        let columns = (x + RADIUS + 1).min(width) - x.saturating_sub(RADIUS);
        2 * *darker as usize > rows.len() * columns
    };
    darker.iter().enumerate().map(is_most).collect()
}

#[apply(multiversioned!)]
fn count_darker(low: &[f32], values: &[f32], darker: &mut [i32]) {
    let pixels = low.iter().zip(values).zip(darker);
    pixels.for_each(|((low, value), darker)| *darker += i32::from(value < low));
}

/// Returns the luminance that a pixel is clamped to, or `None` if it does not exceed its bound, which follows from the pixels around
/// that are known: those with samples. Pixels whose neighbours are mostly black have no bound: all light there is rare, and clamping
/// would leave nothing.
fn bound(
    luminances: &[f32],
    is_known: impl Fn(usize) -> bool,
    (x, y): (usize, usize),
    (width, height): (usize, usize),
    settings: &FireflySettings,
) -> Option<f32> {
    // Collect the luminances of the window
    let own = luminances[y * width + x];
    let mut window = [0.0; (2 * RADIUS + 1).pow(2)];
    let mut n = 0;
    for yj in y.saturating_sub(RADIUS)..=(y + RADIUS).min(height - 1) {
        for xj in x.saturating_sub(RADIUS)..=(x + RADIUS).min(width - 1) {
            let j = yj * width + xj;
            if is_known(j) {
                window[n] = luminances[j];
                n += 1;
            }
        }
    }
    let window = &mut window[..n];

    // Compute the bound from median and median absolute deviation
    let median = median(window);
    if median <= 0.0 {
        return None;
    }
    window.iter_mut().for_each(|l| *l = (*l - median).abs());
    let deviation = 1.48 * self::median(window);
    let bound = settings.median_factor * median + settings.deviation_factor * deviation;
    (own > bound).then_some(if settings.clamp_to_median { median } else { bound })
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Luminance of pixel `i` of 3 planes.
pub fn pixel_luminance(planes: &Planes, i: usize) -> f32 {
    luminance([0, 1, 2].map(|k| planes.plane(k)[i]))
}

#[cfg(test)]
pub(super) mod tests;
