//! Distances and weights against their formulas, in double precision.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;

const WIDTH: usize = 23;
const HEIGHT: usize = 11;
const INVERSE_BANDWIDTH: f32 = 2.0;

struct Image {
    value: [Vec<f32>; 3],
    variance: [Vec<f32>; 3],
    features: [Vec<f32>; 2],
}

impl Image {
    fn random() -> Self {
        let mut rng = Pcg32::seed_from_u64(7);
        let mut plane = |most: f32| (0..WIDTH * HEIGHT).map(|_| most * rng.random::<f32>()).collect();
        Self {
            value: [(); 3].map(|()| plane(1.0)),
            variance: [(); 3].map(|()| plane(0.1)),
            features: [(); 2].map(|()| plane(0.5)),
        }
    }

    fn weights(
        &self,
        settings: DistanceSettings,
        tile: Tile,
        mut check: impl FnMut((isize, isize), (isize, isize), f32),
    ) {
        let features = self.features.each_ref().map(Vec::as_slice);
        let guide = ColourGuide {
            value: self.value.each_ref().map(Vec::as_slice),
            variance: self.variance.each_ref().map(Vec::as_slice),
            features: &features,
            feature_inverse_bandwidth: INVERSE_BANDWIDTH,
        };
        PatchDistance::<1>::new(WIDTH, HEIGHT, guide, settings).for_each_neighbour(tile, |neighbours| {
            let (dx, dy) = neighbours.offset;
            assert_eq!(neighbours.weights.len(), tile.width);
            for (x, &weight) in neighbours.weights.iter().enumerate() {
                let (x, y) = ((tile.x + x) as isize, (tile.y + neighbours.row) as isize);
                check((x, y), (x + dx, y + dy), weight);
            }
        });
    }

    /// d_ij by the formula. Patches are extended by the nearest pixel of the image.
    fn distance(&self, settings: DistanceSettings, i: (isize, isize), j: (isize, isize)) -> f64 {
        let k2 = f64::from(settings.k).powi(2);
        let mut sum = 0.0;
        for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
            let at = |plane: &[f32], (x, y): (isize, isize)| {
                let x = (x + dx).clamp(0, WIDTH as isize - 1) as usize;
                let y = (y + dy).clamp(0, HEIGHT as isize - 1) as usize;
                f64::from(plane[y * WIDTH + x])
            };
            for (value, variance) in self.value.iter().zip(&self.variance) {
                let difference = at(value, i) - at(value, j);
                let (v_i, v_j) = (at(variance, i), at(variance, j));
                sum += (difference * difference - v_i - v_i.min(v_j))
                    / (f64::from(settings.epsilon) + k2 * (v_i + v_j));
            }
        }
        sum / 27.0
    }

    fn weight(&self, settings: DistanceSettings, i: (isize, isize), j: (isize, isize)) -> f64 {
        if !(0..WIDTH as isize).contains(&j.0) || !(0..HEIGHT as isize).contains(&j.1) {
            return 0.0;
        }
        let there = self.distance(settings, i, j);
        let back = self.distance(settings, j, i);
        let d = if settings.symmetric_weights { there.max(back) } else { there };
        let index = |(x, y): (isize, isize)| y as usize * WIDTH + x as usize;
        let squared = |plane: &Vec<f32>| f64::from(plane[index(i)] - plane[index(j)]).powi(2);
        let features: f64 = self.features.iter().map(squared).sum();
        (-d.max(0.0) - f64::from(INVERSE_BANDWIDTH) * features).exp()
    }
}

const SETTINGS: DistanceSettings =
    DistanceSettings { radius: 3, k: 0.8, epsilon: 0.02, symmetric_weights: false };

#[test]
fn weights_agree_with_the_formula_for_every_pixel_of_every_tile() {
    let image = Image::random();
    for symmetric_weights in [false, true] {
        let settings = DistanceSettings { symmetric_weights, ..SETTINGS };
        for tile in [
            Tile { x: 0, y: 0, width: WIDTH, height: HEIGHT },
            Tile { x: 5, y: 2, width: 16, height: 7 },
            Tile { x: 22, y: 10, width: 1, height: 1 },
        ] {
            let mut seen = Vec::new();
            image.weights(settings, tile, |i, j, found| {
                let expected = image.weight(settings, i, j);
                let error = (f64::from(found) - expected).abs();
                assert!(error < 1e-4 * expected + 1e-12, "{i:?} {j:?}: {found} for {expected}");
                seen.push((i, j));
            });
            // The disc has 28 pixels without its centre, each visited once
            assert_eq!(seen.len(), 28 * tile.width * tile.height);
            assert!(seen.iter().all(|(i, j)| (i.0 - j.0).pow(2) + (i.1 - j.1).pow(2) <= 9));
            seen.sort_unstable();
            seen.dedup();
            assert_eq!(seen.len(), 28 * tile.width * tile.height);
        }
    }
}

#[test]
fn extreme_pixels_do_not_affect_patches_without_them() {
    let mut image = Image::random();
    image.value[1][3 * WIDTH + 9] = 1e9;
    image.variance[0][7 * WIDTH + 12] = 1e30;
    let within = |(x, y): (isize, isize), at: (isize, isize)| (x - at.0).abs() <= 1 && (y - at.1).abs() <= 1;
    image.weights(SETTINGS, Tile { x: 0, y: 0, width: WIDTH, height: HEIGHT }, |i, j, found| {
        assert!((0.0..=1.0).contains(&found), "{i:?} {j:?}: {found}");
        let has_extreme = [(9, 3), (12, 7)].iter().any(|&at| within(i, at) || within(j, at));
        let expected = image.weight(SETTINGS, i, j);
        // The tolerance is the rounding error of a term of 3000, over 27 k²
        assert!(
            has_extreme || (f64::from(found) - expected).abs() < 1e-4,
            "{i:?} {j:?}: {found} for {expected}"
        );
        let one = within(i, (9, 3)) != within(j, (9, 3));
        assert!(!one || found < 1e-10, "{i:?} {j:?}: {found}");
    });
}

#[test]
fn noisy_tiles_are_reduced_to_pixels_that_filtering_may_change() {
    let flat = vec![0.5; WIDTH * HEIGHT];
    let none = vec![0.0; WIDTH * HEIGHT];
    let noisy_tiles = |noisy: [&[(usize, usize)]; 3], symmetric_weights| {
        let variance = noisy.map(|pixels| {
            let mut variance = none.clone();
            pixels.iter().for_each(|(x, y)| variance[y * WIDTH + x] = 1e-3);
            variance
        });
        let variance = variance.each_ref().map(Vec::as_slice);
        let guide =
            ColourGuide { value: [&flat; 3], variance, features: &[], feature_inverse_bandwidth: 0.0 };
        let settings = DistanceSettings { radius: 1, symmetric_weights, ..SETTINGS };
        let tiles = PatchDistance::<1>::new(WIDTH, HEIGHT, guide, settings).noisy_tiles((8, 4));
        tiles.iter().map(|tile| (tile.x, tile.y, tile.width, tile.height)).collect::<Vec<_>>()
    };
    assert!(noisy_tiles([&[]; 3], true).is_empty() && noisy_tiles([&[]; 3], false).is_empty());
    for c in 0..3 {
        let mut noisy: [&[(usize, usize)]; 3] = [&[]; 3];
        noisy[c] = &[(10, 5)];
        assert_eq!(noisy_tiles(noisy, true), [(10, 5, 1, 1)]);
        assert_eq!(noisy_tiles(noisy, false), [(9, 4, 3, 3)]);
    }
    // A pixel at the corner of a tile is in reach of four tiles
    assert_eq!(noisy_tiles([&[(8, 4)], &[], &[]], true), [(8, 4, 1, 1)]);
    assert_eq!(
        noisy_tiles([&[(8, 4)], &[], &[]], false),
        [(7, 3, 1, 1), (8, 3, 2, 1), (7, 4, 1, 2), (8, 4, 2, 2)]
    );
    // Pixels in two tiles, in one of them a pixel of each channel
    let noisy: [&[(usize, usize)]; 3] = [&[(3, 6)], &[(5, 5), (9, 6)], &[(1, 6)]];
    assert_eq!(noisy_tiles(noisy, true), [(1, 5, 5, 2), (9, 6, 1, 1)]);
    assert_eq!(noisy_tiles(noisy, false), [(0, 4, 7, 4), (8, 5, 3, 3)]);
}

#[test]
fn tiles_cover_every_pixel_exactly_once() {
    let mut covered = vec![0; WIDTH * HEIGHT];
    for Tile { x, y, width, height } in tiles(WIDTH, HEIGHT, (8, 4)) {
        assert!(width <= 8 && height <= 4);
        for (x, y) in (y..y + height).flat_map(|y| (x..x + width).map(move |x| (x, y))) {
            covered[y * WIDTH + x] += 1;
        }
    }
    assert!(covered.iter().all(|&n| n == 1));
}
