//! The patch-distance filter: non-local means in which one half of the samples decides the weights
//! of the other half.
//!
//! Source: Rousselle, Knaus and Zwicker (2012), cross-filtered between two sample buffers as there;
//! the weights are those of [`distance`](super::distance).

use multiversion::multiversion;
use rayon::prelude::*;

use super::bordered::{Bordered, Margin};
use super::distance::{Distance, DistanceSettings, Guide, Tile};
use super::halves::Estimate;

/// Half side of the 7×7 patch.
const PATCH: usize = 3;
/// Tile in pixels: its rows of scratch fit the first-level cache.
const TILE: (usize, usize) = (256, 64);

/// Filters `original` with weights from `guide`. All planes have `width`×`height` finite values.
pub(super) fn filter(
    width: usize,
    height: usize,
    original: [&[f32]; 3],
    guide: Guide,
    settings: DistanceSettings,
) -> Estimate {
    let mut filtered = Estimate::unfiltered(width, height, original);
    if width == 0 || height == 0 {
        return filtered;
    }
    let distance = Distance::<PATCH>::new(width, height, guide, settings);
    let values = Bordered::new(width, height, &original, settings.radius, Margin::Nearest);
    let tiles = distance.noisy_tiles(TILE);
    let sums: Vec<Sums> = tiles.par_iter().map(|&tile| Sums::of(tile, &distance, &values)).collect();
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
            for (out, &weight) in filtered.own_weight[start..][..tile.width].iter_mut().zip(weights) {
                *out = 1.0 / weight;
            }
        }
    }
    if settings.cautious {
        restore_certain(&mut filtered, original, guide.variance);
    }
    filtered
}

/// With caution a pixel without variance keeps its value.
fn restore_certain(filtered: &mut Estimate, original: [&[f32]; 3], variance: [&[f32]; 3]) {
    for i in (0..filtered.own_weight.len()).filter(|&i| variance.iter().all(|v| v[i] == 0.0)) {
        (0..3).for_each(|channel| filtered.value.plane_mut(channel)[i] = original[channel][i]);
        filtered.own_weight[i] = 1.0;
    }
}

/// Weighted sums of a tile: three channels and the weights.
struct Sums {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Sums {
    fn of(tile: Tile, distance: &Distance<PATCH>, values: &Bordered) -> Self {
        let Tile { x, y, width, height } = tile;
        let mut sums = Self { width, height, data: vec![0.0; 4 * width * height] };
        let (x, y) = (x as isize, y as isize);
        // A pixel's own value has weight one.
        for row in 0..height {
            let [r, g, b, weight] = sums.rows_mut(row);
            for (channel, sum) in [r, g, b].into_iter().enumerate() {
                sum.copy_from_slice(values.span(channel, x, y + row as isize, width));
            }
            weight.fill(1.0);
        }
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

    /// A row of all four planes.
    fn rows_mut(&mut self, y: usize) -> [&mut [f32]; 4] {
        let width = self.width;
        let mut planes = self.data.chunks_exact_mut(width * self.height);
        std::array::from_fn(|_| &mut planes.next().expect("four planes")[y * width..][..width])
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
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

    const SETTINGS: DistanceSettings = DistanceSettings { radius: 2, k: 0.7, epsilon: 1e-3, cautious: false };

    /// Three planes of random numbers up to `most`.
    fn random(pixels: usize, most: f32, seed: u64) -> [Vec<f32>; 3] {
        let mut rng = Pcg32::seed_from_u64(seed);
        [(); 3].map(|()| (0..pixels).map(|_| most * rng.random::<f32>()).collect())
    }

    fn three(planes: &[Vec<f32>; 3]) -> [&[f32]; 3] {
        planes.each_ref().map(Vec::as_slice)
    }

    fn guide<'a>(value: &'a [Vec<f32>; 3], variance: &'a [Vec<f32>; 3]) -> Guide<'a> {
        Guide { value: three(value), variance: three(variance), features: &[], feature_gain: 1.0 }
    }

    #[test]
    fn every_pixel_is_the_mean_of_its_neighbours_by_their_weights_across_tiles() {
        // Two tiles and a rest along both axes.
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
        Distance::<PATCH>::new(width, height, guide, SETTINGS).for_each_neighbour(whole, |neighbours| {
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
            assert!((f64::from(filtered.own_weight[i]) * sums[3] - 1.0).abs() < 1e-3, "{i}");
        }
    }

    #[test]
    fn with_caution_pixels_without_variance_in_any_channel_keep_their_value() {
        let (width, height) = (20, 12);
        let (original, mut variance) = (random(width * height, 0.2, 5), random(width * height, 0.3, 6));
        let (certain, partly) = (5 * width + 7, 8 * width + 13);
        variance.iter_mut().for_each(|plane| plane[certain] = 0.0);
        variance[0][partly] = 0.0;
        for cautious in [false, true] {
            let settings = DistanceSettings { cautious, ..SETTINGS };
            let filtered = filter(width, height, three(&original), guide(&original, &variance), settings);
            let kept = |i: usize| (0..3).all(|c| filtered.value.plane(c)[i] == original[c][i]);
            assert_eq!((kept(certain), filtered.own_weight[certain] == 1.0), (cautious, cautious));
            assert!(!kept(partly) && filtered.own_weight[partly] < 1.0);
        }
    }

    #[test]
    fn what_has_no_noise_is_left_alone_and_an_empty_image_is_empty() {
        let (original, none) = (random(30, 1.0, 9), random(30, 0.0, 9));
        let filtered = filter(6, 5, three(&original), guide(&original, &none), SETTINGS);
        assert!((0..3).all(|c| filtered.value.plane(c) == original[c]));
        assert_eq!(filtered.own_weight, [1.0; 30]);
        for (width, height) in [(0, 0), (0, 3), (3, 0)] {
            let empty = filter(width, height, [&[]; 3], guide(&random(0, 1.0, 1), &none), SETTINGS);
            assert!(empty.own_weight.is_empty());
        }
    }
}
