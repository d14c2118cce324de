//! Filters an image by non-local means (Rousselle, Knaus and Zwicker 2012): the mean of the pixels in a disc,
//! with the weights of [`patch_distance`](super::patch_distance).
//!
//! The image is one half of the samples and the guide is the other, so that the result is linear in the image.

use rayon::prelude::*;

use super::patch_distance::{ColourGuide, DistanceSettings, PatchDistance, Tile};
use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::linear_estimate::LinearEstimate;
use crate::filter::common::padded_planes::{Margin, PaddedPlanes};
use crate::simd::{apply, multiversioned};

/// Half side of the 7×7 patch.
const PATCH: usize = 3;
/// Size of tiles in pixels. The rows of scratch memory of a tile fit the first-level cache.
const TILE: (usize, usize) = (256, 64);

/// Filters `original` with weights from `guide`. All planes have `width`×`height` finite values.
pub fn filter(
    width: usize,
    height: usize,
    original: [&[f32]; 3],
    guide: ColourGuide,
    settings: DistanceSettings,
) -> LinearEstimate {
    let mut filtered = LinearEstimate::unfiltered(width, height, original);
    if width == 0 || height == 0 {
        return filtered;
    }
    let distance = PatchDistance::<PATCH>::new(width, height, guide, settings);
    let values = PaddedPlanes::new(width, height, &original, settings.radius, Margin::Nearest);

    // Sum the tiles with noise
    let tiles = distance.noisy_tiles(TILE);
    let sum = |&tile: &Tile| {
        stop_if_cancelled();
        Sums::new(tile, &distance, &values)
    };
    let sums: Vec<Sums> = tiles.par_iter().map(sum).collect();

    // Divide by the sums of weights
    for (tile, sums) in tiles.iter().zip(&sums) {
        for row in 0..tile.height {
            let start = (tile.y + row) * width + tile.x;
            let weights = sums.row(3, row);
            for channel in 0..3 {
                let out = &mut filtered.value.plane_mut(channel)[start..][..tile.width];
                for ((out, &sum), &weight) in out.iter_mut().zip(sums.row(channel, row)).zip(weights) {
                    *out = sum / weight;
                }
            }
            for (out, &weight) in filtered.derivative[start..][..tile.width].iter_mut().zip(weights) {
                *out = 1.0 / weight;
            }
        }
    }
    filtered.restore(original, &distance.changed_pixels());
    filtered
}

/// Sums over a tile: three weighted channels, and the weights.
struct Sums {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Sums {
    fn new(tile: Tile, distance: &PatchDistance<PATCH>, values: &PaddedPlanes) -> Self {
        let Tile { x, y, width, height } = tile;
        let mut sums = Self { width, height, data: vec![0.0; 4 * width * height] };
        let (x, y) = (x as isize, y as isize);
        // The pixel itself has weight 1
        for row in 0..height {
            let [r, g, b, weight] = sums.rows_mut(row);
            for (channel, sum) in [r, g, b].into_iter().enumerate() {
                sum.copy_from_slice(values.span(channel, x, y + row as isize, width));
            }
            weight.fill(1.0);
        }

        // Add its neighbours
        distance.for_each_neighbour(tile, |neighbours| {
            let (dx, dy) = neighbours.offset;
            let y = y + neighbours.row as isize + dy;
            let from = std::array::from_fn(|c| values.span(c, x + dx, y, width));
            let [r, g, b, sum] = sums.rows_mut(neighbours.row);
            accumulate(neighbours.weights, from, r, g, b, sum);
        });
        sums
    }

    fn row(&self, plane: usize, y: usize) -> &[f32] {
        &self.data[(plane * self.height + y) * self.width..][..self.width]
    }

    /// Returns a row of all four planes.
    fn rows_mut(&mut self, y: usize) -> [&mut [f32]; 4] {
        let width = self.width;
        let mut planes = self.data.chunks_exact_mut(width * self.height);
        std::array::from_fn(|_| &mut planes.next().expect("four planes")[y * width..][..width])
    }
}

/// Adds a row of neighbours to the sums.
#[apply(multiversioned!)]
fn accumulate(
    weights: &[f32],
    values: [&[f32]; 3],
    sum_r: &mut [f32],
    sum_g: &mut [f32],
    sum_b: &mut [f32],
    sum: &mut [f32],
) {
    let n = weights.len();
    let [r, g, b] = values;
    let (r, g, b) = (&r[..n], &g[..n], &b[..n]);
    let (sum_r, sum_g, sum_b, sum) = (&mut sum_r[..n], &mut sum_g[..n], &mut sum_b[..n], &mut sum[..n]);
    for x in 0..n {
        let w = weights[x];
        sum_r[x] += w * r[x];
        sum_g[x] += w * g[x];
        sum_b[x] += w * b[x];
        sum[x] += w;
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;

    const SETTINGS: DistanceSettings =
        DistanceSettings { radius: 2, k: 0.7, epsilon: 1e-3, symmetric_weights: false };

    /// Three planes of random numbers up to `max`.
    fn random(pixels: usize, max: f32, seed: u64) -> [Vec<f32>; 3] {
        let mut rng = Pcg32::seed_from_u64(seed);
        [(); 3].map(|()| (0..pixels).map(|_| max * rng.random::<f32>()).collect())
    }

    fn three(planes: &[Vec<f32>; 3]) -> [&[f32]; 3] {
        planes.each_ref().map(Vec::as_slice)
    }

    fn guide<'a>(value: &'a [Vec<f32>; 3], variance: &'a [Vec<f32>; 3]) -> ColourGuide<'a> {
        ColourGuide {
            value: three(value),
            variance: three(variance),
            features: &[],
            feature_inverse_bandwidth: 1.0,
        }
    }

    #[test]
    fn pixels_are_weighted_means_of_their_neighbours_across_tiles() {
        // More than a tile along both axes
        let (width, height) = (TILE.0 + 9, TILE.1 + 3);
        let (value, variance) = (random(width * height, 1.0, 1), random(width * height, 0.3, 2));
        let original = random(width * height, 1.0, 3);
        let guide = guide(&value, &variance);
        let filtered = filter(width, height, three(&original), guide, SETTINGS);

        let mut sums: Vec<[f64; 4]> = (0..width * height)
            .map(|i| {
                let [r, g, b] = three(&original).map(|plane| f64::from(plane[i]));
                [r, g, b, 1.0]
            })
            .collect();
        let whole = Tile { x: 0, y: 0, width, height };
        PatchDistance::<PATCH>::new(width, height, guide, SETTINGS).for_each_neighbour(whole, |neighbours| {
            let (dx, dy) = neighbours.offset;
            let Some(yj) = neighbours.row.checked_add_signed(dy).filter(|&y| y < height) else { return };
            for (x, &weight) in neighbours.weights.iter().enumerate() {
                let Some(xj) = x.checked_add_signed(dx).filter(|&x| x < width) else { continue };
                let sums = &mut sums[neighbours.row * width + x];
                let weight = f64::from(weight);
                sums[3] += weight;
                for (sum, plane) in sums.iter_mut().zip(&original) {
                    *sum += weight * f64::from(plane[yj * width + xj]);
                }
            }
        });
        for (i, sums) in sums.iter().enumerate() {
            for c in 0..3 {
                let (found, expected) = (f64::from(filtered.value.plane(c)[i]), sums[c] / sums[3]);
                assert!((found - expected).abs() < 1e-4, "{i} {c}: {found} for {expected}");
            }
            assert!((f64::from(filtered.derivative[i]) * sums[3] - 1.0).abs() < 1e-3, "{i}");
        }
    }

    #[test]
    fn with_symmetric_weights_pixels_without_variance_keep_their_value() {
        let (width, height) = (20, 12);
        let (original, mut variance) = (random(width * height, 0.2, 5), random(width * height, 0.3, 6));
        let (noise_free, partly_noisy) = (5 * width + 7, 8 * width + 13);
        variance.iter_mut().for_each(|plane| plane[noise_free] = 0.0);
        variance[0][partly_noisy] = 0.0;
        for symmetric_weights in [false, true] {
            let settings = DistanceSettings { symmetric_weights, ..SETTINGS };
            let filtered = filter(width, height, three(&original), guide(&original, &variance), settings);
            let keeps_value = |i: usize| (0..3).all(|c| filtered.value.plane(c)[i] == original[c][i]);
            assert_eq!(
                (keeps_value(noise_free), filtered.derivative[noise_free] == 1.0),
                (symmetric_weights, symmetric_weights)
            );
            assert!(!keeps_value(partly_noisy) && filtered.derivative[partly_noisy] < 1.0);
        }
    }

    #[test]
    fn images_without_noise_do_not_change_and_empty_images_are_accepted() {
        let (original, none) = (random(30, 1.0, 9), random(30, 0.0, 9));
        let filtered = filter(6, 5, three(&original), guide(&original, &none), SETTINGS);
        assert!((0..3).all(|c| filtered.value.plane(c) == original[c]));
        assert_eq!(filtered.derivative, [1.0; 30]);
        for (width, height) in [(0, 0), (0, 3), (3, 0)] {
            let empty = filter(width, height, [&[]; 3], guide(&random(0, 1.0, 1), &none), SETTINGS);
            assert!(empty.derivative.is_empty());
        }
    }
}
