//! An unbiased estimate of an image's error: samples that were taken after the image was made, compared with it.
//!
//! The halves A and B of the new samples are independent of each other, so with F the image,
//! E[(F − c_A)(F − c_B)] = (F − truth)²: no variance has to be estimated. With independent samples that is exact; with
//! points of low discrepancy, whose new ones fill the gaps between the old ones behind F, it is up to 1.6 times too high
//! (measured). Only pixels that were chosen regardless of their priority count, so that the mean over them is one over
//! the image. The relative error has F in place of the unknown truth in its denominator. The image at the end has all
//! samples, so that none are left to measure it: the estimate belongs to the image of the last interim pass.

use super::snapshot::Snapshot;
use crate::image::Planes;
use crate::image::metrics::RELMSE_EPSILON;
use crate::stats::Store;

/// Side of the tiles, in pixels.
pub const TILE: usize = 16;

/// The error of a filtered image falls as the samples to this power: on our five scenes, sampled adaptively with 16 to 32
/// samples per pixel, to 0.62 to 0.93.
const ERROR_POWER: f64 = 0.7;

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// relMSE of the image: a noisy estimate, so it may be negative where the error is tiny.
    pub image: f64,
    /// Standard error of `image`.
    pub standard_error: f64,
    /// Samples that the image was made of.
    pub samples: u64,
    /// Samples that were compared with images; those that were compared with an earlier image count less.
    pub weight: f64,
    /// relMSE by tile of 16×16 pixels, 1 plane; the image's where a tile has no new samples.
    pub tiles: Planes,
}

/// An estimate in short, for the page and the progress bar.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct EstimateSummary {
    /// relMSE of the image, or its upper bound if noise hides it.
    pub error: f64,
    pub is_hidden: bool,
    /// Samples that the image was made of.
    pub samples: u64,
}

impl ErrorEstimate {
    /// Returns the estimate in short.
    pub fn summary(&self) -> EstimateSummary {
        let is_hidden = self.is_hidden();
        let error = if is_hidden { self.upper_bound() } else { self.image };
        EstimateSummary { error, is_hidden, samples: self.samples }
    }

    /// Returns the relMSE as it is shown: an error is not negative.
    pub fn value(&self) -> f64 {
        self.image.max(0.0)
    }

    /// Returns the interval that holds the error with 95 % confidence, as far as the standard error can tell.
    pub fn interval(&self) -> [f64; 2] {
        [-1.96, 1.96].map(|deviations| (self.image + deviations * self.standard_error).max(0.0))
    }

    /// Returns an upper bound of the error, one standard error above the estimate: it is compared with a target.
    pub fn upper_bound(&self) -> f64 {
        self.image.max(0.0) + self.standard_error
    }

    /// Returns whether noise hides the error, so that `image` is no measured figure.
    pub fn is_hidden(&self) -> bool {
        self.image <= self.standard_error && self.upper_bound() > 0.0
    }

    /// Returns the tiles' estimates at every pixel of an image of the size that they were made for: 1 plane.
    pub fn to_pixels(&self, width: usize, height: usize) -> Planes {
        let mut pixels = Planes::new(width, height, 1);
        for (y, row) in pixels.data_mut().chunks_mut(width.max(1)).enumerate() {
            for (x, value) in row.iter_mut().enumerate() {
                *value = self.tiles.at(0, x / TILE, y / TILE);
            }
        }
        pixels
    }

    /// Averages the estimate with that of an earlier image, whose error has fallen since by a power of the samples. What
    /// is known of an earlier image counts by the samples that it rests on, times the ratio of the images' samples: not by
    /// standard errors, because an estimate that is too low by chance has a low one as well.
    pub(super) fn combined_with(self, earlier: Option<Self>) -> Self {
        let is_usable = |earlier: &Self| {
            // A state from elsewhere may hold anything.
            let numbers = [earlier.image, earlier.standard_error, earlier.weight];
            (1..self.samples).contains(&earlier.samples) && numbers.iter().all(|v| v.abs() < 1e30)
        };
        let Some(earlier) = earlier.filter(is_usable).filter(|earlier| earlier.weight >= 0.0) else {
            return self;
        };
        let growth = self.samples as f64 / earlier.samples as f64;
        let scale = growth.powf(-ERROR_POWER);
        let earlier_weight = earlier.weight / growth;
        let weight = self.weight + earlier_weight;
        let [new, old] = [self.weight / weight, scale * earlier_weight / weight];
        let mut tiles = self.tiles;
        for (tile, earlier) in tiles.data_mut().iter_mut().zip(earlier.tiles.data()) {
            *tile = new as f32 * *tile + old as f32 * earlier;
        }
        Self {
            image: new * self.image + old * earlier.image,
            standard_error: (new * self.standard_error).hypot(old * earlier.standard_error),
            weight,
            tiles,
            ..self
        }
    }

    /// Compares the samples of `store` since `before` with `shown`, the image of that time, at the pixels that `probes`
    /// marks; `None` if none of them got samples in both halves.
    pub(super) fn new(shown: &Planes, before: &Snapshot, store: &Store, probes: &[bool]) -> Option<Self> {
        // Compare the means of the new samples with the image
        let after = Snapshot::new(store);
        let (width, height) = (shown.width(), shown.height());
        let mut tiles = Planes::new(width.div_ceil(TILE), height.div_ceil(TILE), 1);
        let mut tile_counts = vec![0u32; tiles.pixels()];
        let columns = tiles.width();
        let (mut sum, mut squares, mut count, mut compared) = (0.0, 0.0, 0u64, 0u64);
        for i in (0..width * height).filter(|&i| probes[i]) {
            let added = [0, 1].map(|h| after.count[h][i] - before.count[h][i]);
            if added.contains(&0) {
                continue;
            }
            let new_mean = |h: usize, c: usize| {
                let (n, m) = (after.count[h][i] as f32, added[h] as f32);
                let (old, new) = (before.mean[h].plane(c)[i], after.mean[h].plane(c)[i]);
                old + (new - old) * (n / m)
            };
            let relative = |c: usize| {
                let f = shown.plane(c)[i];
                (f - new_mean(0, c)) * (f - new_mean(1, c)) / (f * f + RELMSE_EPSILON as f32)
            };
            let error = (0..3).map(relative).sum::<f32>() / 3.0;
            sum += f64::from(error);
            squares += f64::from(error).powi(2);
            count += 1;
            compared += u64::from(added[0]) + u64::from(added[1]);
            let tile = i / width / TILE * columns + i % width / TILE;
            tiles.plane_mut(0)[tile] += error;
            tile_counts[tile] += 1;
        }
        if count == 0 {
            return None;
        }

        // Average over the pixels
        let image = sum / count as f64;
        let spread = ((squares / count as f64 - image * image).max(0.0) / count as f64).sqrt();
        // One pixel alone has no deviation.
        let standard_error = if count > 1 { spread } else { image.abs() };
        for (tile, &n) in tiles.plane_mut(0).iter_mut().zip(&tile_counts) {
            *tile = if n > 0 { *tile / n as f32 } else { image as f32 };
        }
        let samples = before.count.iter().flatten().map(|&n| u64::from(n)).sum();
        Some(Self { image, standard_error, samples, weight: compared as f64, tiles })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Layout;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_mean_estimate_is_the_true_error_of_the_image_shown() {
        let layout = Layout::with_blocks(|_| false);
        let (width, height, truth) = (64, 64, 0.5);
        let mut rng = rand_pcg::Pcg64::seed_from_u64(1);
        let mut store = Store::new(width, height, layout.clone(), 0, 0);
        let mut add = |store: &mut Store, n: usize| {
            for i in 0..width * height {
                let sample = |_| {
                    let v = truth * 2.0 * rng.random::<f32>();
                    [0.0, 0.0, v, v, v]
                };
                store.push(i % width, i / width, &(0..n).flat_map(sample).collect::<Vec<_>>());
            }
        };
        add(&mut store, 4);
        let before = Snapshot::new(&store);
        let mut shown = Planes::new(width, height, 3);
        shown.data_mut().fill(truth + 0.1);
        add(&mut store, 4);
        let estimate = ErrorEstimate::new(&shown, &before, &store, &vec![true; width * height]).unwrap();
        let expected = 0.01 / (0.36 + 0.01);
        // Standard error: pixels have (σ²/2 + …)/0.37 ≈ 0.15, over 4096 of them.
        assert!((estimate.image - expected).abs() < 4.0 * 0.15 / 64.0, "{} {expected}", estimate.image);
        assert_eq!(estimate.tiles.pixels(), 16);
        assert_eq!(estimate.samples, 4 * (width * height) as u64);
        let pixels = estimate.to_pixels(width, height);
        assert_eq!(pixels.at(0, 17, 40), estimate.tiles.at(0, 1, 2));
    }

    #[test]
    fn estimates_of_several_images_are_averaged_at_the_last_ones_samples() {
        let of = |samples, image, standard_error, weight| {
            let mut tiles = Planes::new(1, 1, 1);
            tiles.data_mut().fill(image as f32);
            ErrorEstimate { image, standard_error, samples, weight, tiles }
        };
        let earlier = of(10, 2.0, 0.1, 60.0);
        // The earlier image counts 60 ∕ 2 of 100.
        let both = of(20, 1.0, 0.5, 70.0).combined_with(Some(earlier.clone()));
        let scale = 0.5f64.powf(0.7);
        let expected = 0.7 + 0.3 * 2.0 * scale;
        assert!(
            (both.image - expected).abs() < 1e-12 && (both.tiles.data()[0] - expected as f32).abs() < 1e-6
        );
        assert!((both.standard_error - 0.35f64.hypot(0.03 * scale)).abs() < 1e-12);
        assert_eq!((both.samples, both.weight), (20, 100.0));
        let same = of(10, 1.0, 0.5, 80.0);
        assert_eq!(same.clone().combined_with(Some(earlier)), same, "more samples, same image");
        assert_eq!(same.clone().combined_with(None), same);
    }

    #[test]
    fn one_lucky_estimate_is_outvoted() {
        let of = |samples, image| ErrorEstimate {
            image,
            standard_error: 0.1 * image,
            samples,
            weight: 50.0,
            tiles: Planes::new(1, 1, 1),
        };
        let mut estimate = of(100, 1e-6);
        for samples in (200..2000).step_by(100) {
            estimate = of(samples, 0.1).combined_with(Some(estimate));
        }
        assert!((0.05..0.1).contains(&estimate.image), "{}", estimate.image);
    }

    #[test]
    fn what_is_shown_is_never_negative() {
        let estimate = ErrorEstimate {
            image: -1.0,
            standard_error: 1.0,
            samples: 1,
            weight: 1.0,
            tiles: Planes::new(1, 1, 1),
        };
        assert_eq!((estimate.value(), estimate.interval()), (0.0, [0.0, 0.96]));
    }

    #[test]
    fn without_new_samples_there_is_no_estimate() {
        let store = Store::new(4, 4, Layout::with_blocks(|_| false), 0, 0);
        let before = Snapshot::new(&store);
        assert!(ErrorEstimate::new(&Planes::new(4, 4, 3), &before, &store, &[true; 16]).is_none());
    }
}
