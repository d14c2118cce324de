//! The filter as a whole, and helpers for the tests of its steps.

use rand::RngExt;

use super::super::synthetic::{store, wall};
use super::*;
use crate::image::Planes;
use crate::stats::{Block, Layout};

fn everything() -> Layout {
    Layout::with_blocks(|_| true)
}

/// The method with windows for small images.
fn small() -> RpfSettings {
    let mut settings = RpfSettings::energy_kept();
    settings.passes = [15, 7].map(|window| RpfPass { window, fraction: 0.5 }).to_vec();
    settings
}

/// A wall lit with noise of mean `colour`.
fn noisy_wall(width: usize, height: usize, colour: f32, count: impl Fn(usize, usize) -> u32 + Sync) -> Store {
    let layout = everything();
    store(width, height, layout.clone(), count, |x, y, _, rng| {
        let light = 2.0 * colour * rng.random::<f32>();
        wall(&layout, x, y, [light, 0.7 * light, 0.3 * light], rng)
    })
}

fn assert_finite(filtered: &FilterResult) {
    let FilterResult { image, halves: [a, b], residual, variance, error, .. } = filtered;
    for planes in [image, a, b, residual, variance, error] {
        assert!(planes.data().iter().all(|v| v.is_finite()));
    }
}

fn variance(values: &[f32]) -> f32 {
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32
}

#[test]
fn a_constant_image_is_reproduced_exactly() {
    let layout = everything();
    for settings in
        [RpfSettings::energy_kept(), RpfSettings::report(), RpfSettings::release(), RpfSettings::lehtinen()]
    {
        for colour in [[0.0; 3], [0.3, 0.123, 7.7]] {
            let store =
                store(12, 9, layout.clone(), |_, _| 4, |x, y, _, rng| wall(&layout, x, y, colour, rng));
            let filtered = filter(&store, &settings, 1);
            for (k, colour) in colour.iter().enumerate() {
                assert!(filtered.image.plane(k).iter().all(|v| v == colour));
            }
            assert_finite(&filtered);
        }
    }
}

#[test]
fn images_of_every_size_and_count_are_filtered_with_all_settings() {
    for (width, height) in [(1, 1), (1, 20), (9, 1), (2, 2), (6, 11)] {
        for count in [1, 2, 3, 8] {
            for settings in [
                RpfSettings::energy_kept(),
                RpfSettings::report(),
                RpfSettings::release(),
                RpfSettings::lehtinen(),
            ] {
                let filtered = filter(&noisy_wall(width, height, 1.0, |_, _| count), &settings, 1);
                assert_eq!((filtered.image.width(), filtered.image.height()), (width, height));
                assert_finite(&filtered);
                assert!(filtered.image.plane(0).iter().all(|&v| (0.0..=2.0).contains(&v)));
            }
        }
    }
    assert!(filter(&noisy_wall(0, 0, 1.0, |_, _| 4), &small(), 1).image.data().is_empty());
}

#[test]
fn pixels_without_samples_are_filled_and_counts_may_differ() {
    let count = |x: usize, y: usize| if x == 4 { 0 } else { 1 + (x * 5 + y * 3) as u32 % 8 };
    let layout = everything();
    let store = store(12, 12, layout.clone(), count, |x, y, _, rng| {
        let side = if x < 4 { [1.0, 0.5, 0.2] } else { [0.4, 0.5, 0.2] };
        wall(&layout, x, y, side, rng)
    });
    let filtered = filter(&store, &small(), 1);
    assert_finite(&filtered);
    assert!((0..12).all(|y| (0.4..=1.0).contains(&filtered.image.at(0, 4, y))));
    assert!(filtered.image.plane(1).iter().all(|v| (v - 0.5).abs() < 1e-6));
    assert!(filter(&noisy_wall(3, 3, 1.0, |_, _| 0), &small(), 1).image.data().iter().all(|&v| v == 0.0));
}

#[test]
fn noise_is_removed_and_edges_are_kept() {
    let layout = everything();
    let store = store(
        24,
        24,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng| {
            // All noise comes from the light sample, the edge from two albedos.
            let albedo = if x < 12 { 0.8 } else { 0.2 };
            let mut sample = wall(&layout, x, y, [0.0; 3], rng);
            let light = 0.5 + sample[layout.block(Block::Light1).unwrap().start];
            layout.write(&mut sample, Block::Radiance, &[albedo * light; 3]);
            layout.write(&mut sample, Block::Colour, &[albedo * light; 3]);
            layout.write(&mut sample, Block::Albedo, &[albedo; 3]);
            sample
        },
    );
    let noisy = super::super::unfiltered(&store).image;
    let filtered = filter(&store, &small(), 1).image;
    let left = |image: &Planes, y: usize| image.row(0, y)[..12].to_vec();
    let noise = |image: &Planes| (0..24).map(|y| variance(&left(image, y))).sum::<f32>();
    assert!(noise(&filtered) < 0.03 * noise(&noisy), "{} of {}", noise(&filtered), noise(&noisy));
    for y in 0..24 {
        let [inner, outer] = [filtered.at(0, 11, y), filtered.at(0, 12, y)];
        assert!((inner - 0.8).abs() < 0.08 && (outer - 0.2).abs() < 0.04, "{inner} | {outer}");
    }
}

#[test]
fn the_denoiser_keeps_the_energy_of_fireflies() {
    let store = noisy_wall(10, 8, 1.0, |_, _| 4);
    let image = RPF.filter(&store, 1).image;
    assert_eq!(image, filter(&store, &RpfSettings::energy_kept(), 1).image);
    assert_ne!(image, filter(&store, &RpfSettings::report(), 1).image);
}

#[test]
fn scaled_radiance_gives_a_scaled_image() {
    let reference = filter(&noisy_wall(12, 10, 1.0, |_, _| 8), &small(), 1).image;
    for scale in [1e-6, 1e6] {
        let image = filter(&noisy_wall(12, 10, scale, |_, _| 8), &small(), 1).image;
        for (a, b) in reference.data().iter().zip(image.data()) {
            assert!((a - b / scale).abs() < 1e-3, "{scale}: {a} {b}");
        }
    }
}

#[test]
fn the_image_depends_on_the_seed_and_not_on_the_number_of_threads() {
    let store = noisy_wall(16, 12, 1.0, |_, _| 4);
    let with = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| filter(&store, &small(), seed).image)
    };
    let one = with(1, 5);
    assert_eq!(one, with(3, 5));
    assert_ne!(one, with(1, 6));
}

#[test]
fn the_halves_are_independent_images_whose_mean_is_the_image() {
    let filtered = filter(&noisy_wall(16, 16, 1.0, |_, _| 8), &small(), 1);
    let [a, b] = &filtered.halves;
    for i in 0..3 * 256 {
        let mean = 0.5 * (a.data()[i] + b.data()[i]);
        assert!((mean - filtered.image.data()[i]).abs() < 1e-5);
    }
    // The mean over about 450 samples of a colour that is uniform in [0, 2)
    let deviation = (filtered.variance.plane(0).iter().sum::<f32>() / 256.0).sqrt();
    assert!((0.005..0.1).contains(&deviation), "{deviation}");
}

/// A pixel with the given samples.
pub(super) fn one_pixel(layout: &Layout, samples: &[Vec<f32>]) -> Store {
    let mut store = Store::new(1, 1, layout.clone(), samples.len(), 1);
    samples.iter().for_each(|sample| store.push(0, 0, sample));
    store
}

/// Candidates and clustering of a pass over a window of 7.
pub(super) fn candidates(samples: &Samples, layout: &Layout) -> (CandidateSampler, Clustering) {
    let settings = RpfSettings::report();
    let pass = RpfPass { window: 7, fraction: 0.5 };
    (CandidateSampler::new(&pass, &settings, samples), Clustering::new(&settings, layout))
}

#[test]
fn feature_weights_have_the_defaults_with_few_samples_and_are_zero_without() {
    let store = noisy_wall(3, 2, 1.0, |x, _| if x == 1 { 0 } else { 3 });
    let mut settings = small();
    settings.passes = vec![RpfPass { window: 3, fraction: 0.5 }; 2];
    let (names, planes) = feature_weights(&store, &settings, 1);
    assert_eq!((names.len(), planes.len()), (19, 2));
    for planes in planes {
        assert_eq!((planes.width(), planes.height(), planes.count()), (3, 2, 19));
        for (k, y) in (0..19).flat_map(|k| [(k, 0), (k, 1)]) {
            assert_eq!(planes.at(k, 1, y), 0.0);
            // With 9 samples features have equal weights, colours none, and 7 of 9 dimensions are random.
            let expected = match k {
                0..15 => 1.0 / 15.0,
                18 => 7.0 / 9.0,
                _ => 0.0,
            };
            assert!((planes.at(k, 2, y) - expected).abs() < 1e-6, "{k}: {}", planes.at(k, 2, y));
        }
    }
}
