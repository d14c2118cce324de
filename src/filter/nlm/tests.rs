//! The filter as a whole.

use super::*;
use crate::filter::synthetic;
use crate::stats::{LARGEST_VALUE, Layout, Part};
use rand::RngExt;
use rand_pcg::Pcg32;

/// A wall whose radiance is `truth(x, y)` plus uniform noise of the same mean.
fn noisy_wall(width: usize, height: usize, spp: u32, truth: impl Fn(usize, usize) -> f32 + Sync) -> Store {
    let layout = Layout::with_blocks(|_| true);
    synthetic::store(
        width,
        height,
        layout.clone(),
        |_, _| spp,
        |x, y, _, rng: &mut Pcg32| {
            let v = truth(x, y) * 2.0 * rng.random::<f32>();
            synthetic::wall(&layout, x, y, [v; 3], rng)
        },
    )
}

fn constant(width: usize, height: usize, value: f32) -> Store {
    let layout = Layout::with_blocks(|_| true);
    synthetic::store(
        width,
        height,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng: &mut Pcg32| synthetic::wall(&layout, x, y, [value; 3], rng),
    )
}

fn both() -> [NlmSettings; 2] {
    [NlmSettings::standard(), NlmSettings::draft()]
}

fn mse(image: &Planes, truth: impl Fn(usize, usize) -> f32) -> f64 {
    let width = image.width();
    let error = |(i, &v): (usize, &f32)| {
        let i = i % image.pixels();
        f64::from(v - truth(i % width, i / width)).powi(2)
    };
    image.data().iter().enumerate().map(error).sum::<f64>() / image.data().len() as f64
}

#[test]
fn constant_images_of_any_size_are_reproduced_exactly() {
    for (width, height) in [(1, 1), (1, 13), (13, 1), (7, 5), (61, 67)] {
        for value in [0.0, 0.25, 1e-6, 1e6] {
            let store = constant(width, height, value);
            for settings in both() {
                let image = filter(&store, &settings).image;
                assert!(
                    image.data().iter().all(|v| (v - value).abs() <= 1e-6 * value),
                    "{width}x{height} {value}"
                );
            }
        }
    }
}

#[test]
fn noise_is_removed_and_edges_are_kept() {
    let truth = |x: usize, _: usize| if x < 48 { 0.1 } else { 0.8 };
    let store = noisy_wall(96, 64, 16, truth);
    let noisy = mse(&store.means(Part::Whole, store.layout().radiance()), truth);
    let filtered = filter(&store, &NlmSettings::standard());
    assert!(mse(&filtered.image, truth) < noisy / 30.0);
    let draft = filter(&store, &NlmSettings::draft());
    assert!(mse(&draft.image, truth) < noisy / 10.0);
}

#[test]
fn with_many_samples_the_image_converges_to_the_mean() {
    // Any blur would destroy a texture finer than the patch.
    let truth = |x: usize, y: usize| if (x + y).is_multiple_of(2) { 0.3 } else { 0.5 };
    let store = noisy_wall(40, 40, 4096, truth);
    let noisy = mse(&store.means(Part::Whole, store.layout().radiance()), truth);
    assert!(mse(&filter(&store, &NlmSettings::standard()).image, truth) <= noisy);
}

#[test]
fn scaled_radiance_gives_a_scaled_image() {
    let truth = |x: usize, y: usize| 0.1 + 0.01 * (x + y) as f32;
    let image = filter(&noisy_wall(40, 40, 8, truth), &NlmSettings::standard()).image;
    for scale in [1e-6, 1e6] {
        let scaled =
            filter(&noisy_wall(40, 40, 8, |x, y| scale * truth(x, y)), &NlmSettings::standard()).image;
        let close = |(s, v): (&f32, &f32)| (s / (scale * v) - 1.0).abs() < 1e-3;
        assert!(scaled.data().iter().zip(image.data()).all(close), "{scale}");
    }
}

#[test]
fn a_sample_of_a_hundred_million_leaves_no_halo() {
    let layout = Layout::with_blocks(|_| true);
    let store = |spike: bool| {
        synthetic::store(
            64,
            64,
            layout.clone(),
            |_, _| 8,
            |x, y, index, rng: &mut Pcg32| {
                let v = if spike && (x, y, index) == (32, 32, 3) { 1e8 } else { rng.random::<f32>() };
                synthetic::wall(&layout, x, y, [v; 3], rng)
            },
        )
    };
    for settings in both() {
        let (with, without) = (filter(&store(true), &settings).image, filter(&store(false), &settings).image);
        for y in 0..64 {
            for x in 0..64 {
                let change = (with.at(0, x, y) / without.at(0, x, y) - 1.0).abs();
                assert!(change < 0.05, "{x},{y}: {change}");
            }
        }
    }
}

#[test]
fn the_excess_of_fireflies_goes_to_surfaces_and_not_to_the_background() {
    let layout = Layout::with_blocks(|_| true);
    let (horizon, shadow) = (24, 28);
    let store = |spike: bool| {
        synthetic::store(
            64,
            64,
            layout.clone(),
            |_, _| 8,
            |x, y, index, rng: &mut Pcg32| {
                let noise = rng.random::<f32>();
                let is_spike = spike && (x, y, index) == (32, 28, 3);
                let v =
                    if x < shadow || y < horizon { 0.0 } else { noise + if is_spike { 100.0 } else { 0.0 } };
                let mut sample = synthetic::wall(&layout, x, y, [v; 3], rng);
                if y < horizon {
                    layout.write(&mut sample, Block::Normal1, &[0.0; 3]);
                    layout.write(&mut sample, Block::Hit, &[0.0]);
                }
                sample
            },
        )
    };
    for settings in both() {
        let (with, without) = (filter(&store(true), &settings).image, filter(&store(false), &settings).image);
        let change = |x, y| with.at(0, x, y) - without.at(0, x, y);
        let of_sky = (0..64 * (horizon - 1)).map(|i| change(i % 64, i / 64)).fold(0.0, f32::max);
        assert!(of_sky < 1e-4, "the sky is as it was, but for {of_sky}");
        assert!(without.at(0, shadow - 6, 32) < 1e-3);
        assert!(change(shadow - 6, 32) > 1e-3, "a black surface may be one that light rarely reaches");
    }
}

fn assert_finite(filtered: &FilterResult, what: f32) {
    let FilterResult { image, halves: [a, b], residual, variance, error, .. } = filtered;
    for planes in [image, a, b, residual, variance, error] {
        assert!(planes.data().iter().all(|v| v.is_finite()), "{what}");
    }
}

#[test]
fn the_darkest_images_are_finite() {
    for radiance in [1e-45, 1e-40, 1e-30, 1e-22, 1e-21, 1e-20, 5e-20, 1e-18, 1e-15] {
        let store = noisy_wall(24, 17, 8, |x, _| if x < 12 { radiance } else { 2.0 * radiance });
        both().iter().for_each(|settings| assert_finite(&filter(&store, settings), radiance));
    }
}

#[test]
fn images_of_the_largest_accepted_values_are_finite() {
    let layout = Layout::with_blocks(|_| true);
    for largest in [1e9, 1e12, LARGEST_VALUE] {
        let sample = |x, y, _, rng: &mut Pcg32| {
            let any = |rng: &mut Pcg32| if rng.random() { largest * rng.random::<f32>() } else { 0.0 };
            let mut sample = synthetic::wall(&layout, x, y, [0; 3].map(|_| any(rng)), rng);
            layout.write(&mut sample, Block::Albedo, &[0; 3].map(|_| any(rng)));
            layout.write(&mut sample, Block::Emission, &[0; 3].map(|_| any(rng)));
            sample
        };
        let store = synthetic::store(24, 17, layout.clone(), |_, _| 8, sample);
        assert_eq!(store.rejected(), 0);
        both().iter().for_each(|settings| assert_finite(&filter(&store, settings), largest));
    }
}

#[test]
fn pixels_without_valid_samples_are_filled_from_their_neighbours() {
    let layout = Layout::with_blocks(|_| true);
    let store = synthetic::store(
        32,
        32,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng: &mut Pcg32| {
            let v = if (10..13).contains(&x) && y == 10 { f32::NAN } else { 0.5 };
            synthetic::wall(&layout, x, y, [v; 3], rng)
        },
    );
    assert_eq!(store.rejected(), 24);
    for settings in both() {
        let image = filter(&store, &settings).image;
        assert!(image.data().iter().all(|v| (v - 0.5).abs() < 1e-4));
    }
}

#[test]
fn surfaces_and_background_do_not_mix() {
    let layout = Layout::with_blocks(|_| true);
    let half_sky = |sky: bool| {
        synthetic::store(
            64,
            64,
            layout.clone(),
            |_, _| 16,
            |x, y, _, rng: &mut Pcg32| {
                let v = 0.2 * rng.random::<f32>();
                let mut sample = synthetic::wall(&layout, x, y, [v; 3], rng);
                if sky && y < 32 {
                    let blue = [0.0, 0.0, 5.0];
                    layout.write(&mut sample, Block::Colour, &[0.0; 3]);
                    layout.write(&mut sample, Block::Emission, &blue);
                    layout.write(&mut sample, Block::Radiance, &blue);
                    layout.write(&mut sample, Block::Normal1, &[0.0; 3]);
                    layout.write(&mut sample, Block::Albedo, &[1.0; 3]);
                    layout.write(&mut sample, Block::Hit, &[0.0]);
                }
                sample
            },
        )
    };
    let with = filter(&half_sky(true), &NlmSettings::standard()).image;
    let without = filter(&half_sky(false), &NlmSettings::standard()).image;
    for y in 33..64 {
        for x in 0..64 {
            // Pixels beside the horizon have fewer neighbours and a few per cent more noise.
            assert!((with.at(2, x, y) - without.at(2, x, y)).abs() < 0.02, "{x},{y}");
        }
    }
    assert!((0..64).all(|x| with.at(2, x, 31) == 5.0), "the sky is as it was");
}

#[test]
fn a_crop_is_filtered_as_in_the_whole_image() {
    let truth = |x: usize, y: usize| 0.1 + 0.4 * ((x / 9 + y / 7) % 2) as f32;
    let layout = Layout::with_blocks(|_| true);
    let store = |width: usize, height: usize| {
        synthetic::store(
            width,
            height,
            layout.clone(),
            |_, _| 8,
            |x, y, index, _: &mut Pcg32| {
                use rand::SeedableRng;
                // Random numbers by pixel and sample are the same in the crop.
                let mut rng = Pcg32::seed_from_u64(((y * 1000 + x) * 64) as u64 + u64::from(index));
                let v = truth(x, y) * 2.0 * rng.random::<f32>();
                synthetic::wall(&layout, x, y, [v; 3], &mut rng)
            },
        )
    };
    let whole = filter(&store(120, 110), &NlmSettings::standard()).image;
    let crop = filter(&store(90, 80), &NlmSettings::standard()).image;
    for y in 0..40 {
        for x in 0..50 {
            let (a, b) = (whole.at(0, x, y), crop.at(0, x, y));
            assert!((a / b - 1.0).abs() < 2e-3, "{x},{y}: {a} {b}");
        }
    }
}

#[test]
fn the_error_map_estimates_the_error() {
    let truth = |x: usize, y: usize| 0.2 + 0.5 * ((x / 6 + y / 6) % 2) as f32;
    let (mut estimated, mut actual) = (0.0, 0.0);
    for spp in [8, 16, 32] {
        let store = noisy_wall(96, 96, spp, truth);
        let filtered = filter(&store, &NlmSettings::standard());
        estimated +=
            filtered.error.data().iter().map(|&v| f64::from(v)).sum::<f64>() / filtered.error.pixels() as f64;
        actual += mse(&filtered.image, truth);
    }
    let ratio = estimated / actual;
    assert!((0.6..1.6).contains(&ratio), "{ratio}");
}

#[test]
fn the_image_does_not_depend_on_the_number_of_threads() {
    let store = noisy_wall(70, 130, 8, |x, _| 0.1 + 0.01 * x as f32);
    let image = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| filter(&store, &NlmSettings::standard()).image)
    };
    assert_eq!(image(1), image(2));
}

#[test]
fn sample_counts_from_one_to_ten_thousand_may_be_neighbours() {
    let layout = Layout::with_blocks(|_| true);
    let store = synthetic::store(
        24,
        24,
        layout.clone(),
        |x, _| [1, 2, 7, 10_000][x % 4],
        |x, y, _, rng: &mut Pcg32| {
            let v = rng.random::<f32>();
            synthetic::wall(&layout, x, y, [v; 3], rng)
        },
    );
    let image = filter(&store, &NlmSettings::standard()).image;
    assert!(image.data().iter().all(|v| (v - 0.5).abs() < 0.2));
    assert!(mse(&image, |_, _| 0.5) < 0.01);
}

#[test]
fn drafts_have_smaller_radii_and_bandwidths_grow_with_samples_up_to_a_limit() {
    let [standard, draft] = both();
    assert!(draft.radius < standard.radius && draft.fit_radius == 0 && standard.fit_radius > 0);
    let ks = |s: NlmSettings| [s.k, s.emission_k, s.fit_k, s.fit_emission_k];
    // The fourth root of the ratio of samples to 32: at a ratio of 16 it is 2, above the limit of 1.5.
    for (spp, growth) in [(1.0, 1.0), (32.0, 1.0), (64.0, 2f32.powf(0.25)), (512.0, 1.5)] {
        for (grown, k) in ks(standard.for_samples(spp)).into_iter().zip(ks(standard)) {
            assert!((grown / k - growth).abs() < 1e-6, "{spp}: {grown} of {k}");
        }
    }
}
