//! The method as a whole.

use rand::RngExt;

use super::*;
use crate::filter::synthetic::{store, wall};
use crate::stats::{Block, Layout};

fn everything() -> Layout {
    Layout::with_blocks(|_| true)
}

/// A wall lit with noise of mean `colour`.
fn noisy_wall(width: usize, height: usize, colour: f32, count: impl Fn(usize, usize) -> u32 + Sync) -> Store {
    let layout = everything();
    store(width, height, layout.clone(), count, |x, y, _, rng| {
        let light = 2.0 * colour * rng.random::<f32>();
        wall(&layout, x, y, [light, 0.7 * light, 0.3 * light], rng)
    })
}

fn largest_difference(a: &Planes, b: &Planes) -> f32 {
    assert_eq!(a.data().len(), b.data().len());
    a.data().iter().zip(b.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn assert_finite(filtered: &FilterResult) {
    let FilterResult { image, halves: [a, b], residual, variance, error, .. } = filtered;
    for planes in [image, a, b, residual, variance, error] {
        assert!(planes.data().iter().all(|v| v.is_finite()));
    }
}

#[test]
fn a_black_image_stays_black() {
    let layout = everything();
    let store = store(20, 13, layout.clone(), |_, _| 8, |x, y, _, rng| wall(&layout, x, y, [0.0; 3], rng));
    let filtered = filter(&store, &PrpfSettings::paper(), 1);
    assert!(filtered.image.data().iter().all(|&v| v == 0.0));
    assert!(filtered.error.data().iter().all(|&v| v == 0.0));
    assert_finite(&filtered);
}

#[test]
fn a_constant_image_is_reproduced_exactly() {
    let layout = everything();
    let colour = [0.3, 0.123, 7.7];
    let store = store(20, 13, layout.clone(), |_, _| 8, |x, y, _, rng| wall(&layout, x, y, colour, rng));
    let filtered = filter(&store, &PrpfSettings::paper(), 1);
    for (k, colour) in colour.iter().enumerate() {
        assert!(filtered.image.plane(k).iter().all(|v| v == colour));
    }
    assert!(filtered.variance.data().iter().all(|&v| v == 0.0));
}

#[test]
fn scaled_radiance_gives_a_scaled_image() {
    let settings = PrpfSettings::paper();
    let reference = filter(&noisy_wall(40, 30, 1.0, |_, _| 8), &settings, 1).image;
    for scale in [1e-6, 1e6] {
        let mut image = filter(&noisy_wall(40, 30, scale, |_, _| 8), &settings, 1).image;
        image.data_mut().iter_mut().for_each(|v| *v /= scale);
        let difference = largest_difference(&reference, &image);
        assert!(difference < 1e-3, "{scale}: {difference}");
    }
}

#[test]
fn every_size_is_filtered() {
    for (width, height) in [(1, 1), (1, 40), (33, 1), (2, 2), (6, 11), (17, 5)] {
        let filtered = filter(&noisy_wall(width, height, 1.0, |_, _| 4), &PrpfSettings::paper(), 1);
        assert_eq!((filtered.image.width(), filtered.image.height()), (width, height));
        assert_finite(&filtered);
        assert!(filtered.image.plane(0).iter().all(|&v| v > 0.2 && v < 2.0), "{width}x{height}");
    }
    assert!(filter(&noisy_wall(0, 0, 1.0, |_, _| 4), &PrpfSettings::paper(), 1).image.data().is_empty());
}

#[test]
fn windows_of_any_size_are_filtered() {
    for windows in [vec![7], vec![17, 7], vec![1], vec![3, 71]] {
        let settings = PrpfSettings { windows, ..PrpfSettings::paper() };
        for width in [14, 26, 33] {
            assert_finite(&filter(&noisy_wall(width, 20, 1.0, |_, _| 4), &settings, 1));
        }
    }
}

#[test]
fn noise_on_a_wall_is_removed_and_its_mean_kept() {
    let store = noisy_wall(64, 64, 1.0, |_, _| 8);
    let filtered = filter(&store, &PrpfSettings::paper(), 1);
    let deviation = |planes: &Planes| {
        let plane = planes.plane(0);
        (plane.iter().map(|v| (v - 1.0).powi(2)).sum::<f32>() / plane.len() as f32).sqrt()
    };
    let before = deviation(&store.means(crate::stats::Part::Whole, store.layout().radiance()));
    let after = deviation(&filtered.image);
    assert!(after < before / 5.0, "{before} {after}");
}

#[test]
fn the_image_is_the_mean_of_its_halves_weighted_by_counts() {
    let store = noisy_wall(30, 30, 1.0, |x, y| 1 + (x * y % 7) as u32);
    let filtered = filter(&store, &PrpfSettings::paper(), 1);
    let counts = [0, 1].map(|h| store.counts(crate::stats::Part::Half(h)));
    for i in 0..900 {
        let [a, b] = counts.each_ref().map(|counts| counts[i] as f32);
        let [of_a, of_b] = filtered.halves.each_ref().map(|half| half.data()[i]);
        let mean = (a * of_a + b * of_b) / (a + b);
        assert!((mean - filtered.image.data()[i]).abs() < 1e-5);
    }
}

#[test]
fn pixels_without_samples_are_filled_from_their_neighbours() {
    let store = noisy_wall(40, 40, 1.0, |x, y| if (x + y) % 5 == 0 { 0 } else { 8 });
    let filtered = filter(&store, &PrpfSettings::paper(), 1);
    assert_finite(&filtered);
    assert!(filtered.image.plane(0).iter().all(|&v| v > 0.7 && v < 1.3));
    let none = filter(&noisy_wall(9, 9, 1.0, |_, _| 0), &PrpfSettings::paper(), 1);
    assert!(none.image.data().iter().all(|&v| v == 0.0));
    assert_finite(&none);
}

#[test]
fn images_with_one_sample_per_pixel_are_filtered() {
    let filtered = filter(&noisy_wall(40, 40, 1.0, |_, _| 1), &PrpfSettings::paper(), 1);
    assert_finite(&filtered);
    assert!(filtered.image.plane(0).iter().all(|&v| v > 0.6 && v < 1.4));
}

#[test]
fn interpolation_succeeds_everywhere_on_a_wall_and_agrees_with_direct_weights() {
    let layout = everything();
    let paper = PrpfSettings::paper();
    let even = store(60, 60, layout.clone(), |_, _| 8, |x, y, _, rng| wall(&layout, x, y, [1.0; 3], rng));
    for window in [55, 35, 17, 7] {
        assert_eq!(interpolation(&even, &paper, window).success, 1.0);
        // The windows in the settings have no effect.
        let other = PrpfSettings { windows: vec![1], ..paper.clone() };
        assert_eq!(interpolation(&even, &other, window), interpolation(&even, &paper, window));
    }
    let store = noisy_wall(60, 60, 1.0, |_, _| 8);
    let interpolated = filter(&store, &paper, 1);
    assert!(interpolated.interpolation.is_some_and(|found| found.success > 0.999));
    let direct = filter(&store, &PrpfSettings { upsampling: false, ..paper }, 1);
    assert!(direct.interpolation.is_none());
    let difference = largest_difference(&interpolated.image, &direct.image);
    assert!(difference < 0.02, "{difference}");
}

#[test]
fn interpolation_fails_everywhere_between_dissimilar_pixels() {
    let layout = everything();
    let store = store(
        60,
        60,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng| {
            let mut sample = wall(&layout, x, y, [rng.random(); 3], rng);
            // Every pixel has its own material, dissimilar to all others.
            let material = [x, y, x + 61 * y].map(|v| v as f32);
            layout.write(&mut sample, Block::Albedo, &material);
            sample
        },
    );
    let Interpolation { failure, success } = interpolation(&store, &PrpfSettings::paper(), 17);
    assert_eq!(success, 0.0);
    assert_eq!(filter(&store, &PrpfSettings::paper(), 1).interpolation.map(|found| found.success), Some(0.0));
    // Nodes are not interpolated and do not fail.
    assert_eq!(failure.plane(0).iter().sum::<f32>(), (60 * 60 - 12 * 12) as f32);
}

#[test]
fn surfaces_and_background_do_not_mix() {
    let layout = everything();
    let ground = |x, y, rng: &mut rand_pcg::Pcg32| {
        let light = rng.random::<f32>();
        wall(&layout, x, y, [light, 0.0, 0.0], rng)
    };
    let sky = |x: usize, y: usize, rng: &mut rand_pcg::Pcg32| {
        let mut sample = wall(&layout, x, y, [0.0, 0.0, 3.0], rng);
        layout.write(&mut sample, Block::Hit, &[0.0]);
        sample
    };
    let half_sky = store(
        40,
        40,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng| {
            if y < 20 { sky(x, y, rng) } else { ground(x, y, rng) }
        },
    );
    let filtered = filter(&half_sky, &PrpfSettings::paper(), 1);
    for y in 0..40 {
        let (red, blue) = (filtered.image.row(0, y), filtered.image.row(2, y));
        if y < 20 {
            assert!(red.iter().all(|&v| v == 0.0) && blue.iter().all(|&v| v == 3.0));
        } else {
            assert!(red.iter().all(|&v| (v - 0.5).abs() < 0.15) && blue.iter().all(|&v| v == 0.0));
        }
    }
}

#[test]
fn a_bright_emitter_does_not_light_the_wall_beside_it() {
    // One of 64 samples of the rim, column 20, meets the emitter; the wall has no noise
    let (wall_radiance, emitted) = (0.03, 2000.0);
    let layout = everything();
    let meets_emitter = |x: usize, index: u32| x > 20 || x == 20 && index % 64 == 5;
    let store = store(
        40,
        20,
        layout.clone(),
        |_, _| 64,
        |x, y, index, rng| {
            let mut sample = wall(&layout, x, y, [wall_radiance; 3], rng);
            if meets_emitter(x, index) {
                layout.write(&mut sample, Block::Radiance, &[emitted; 3]);
            }
            sample
        },
    );
    let image = filter(&store, &PrpfSettings::paper(), 1).image;
    for y in 0..20 {
        for x in 0..20 {
            assert_eq!(image.at(0, x, y), wall_radiance, "{x} {y}");
        }
        assert!(image.at(0, 20, y) > 1.0 && image.at(0, 30, y) > 0.9 * emitted, "{y}");
    }
}

#[test]
fn a_firefly_leaves_no_halo() {
    let layout = everything();
    let make = |spike: f32| {
        store(
            60,
            60,
            layout.clone(),
            |_, _| 8,
            |x, y, index, rng| {
                let light = 0.5 + 0.2 * (rng.random::<f32>() - 0.5);
                let light = if (x, y, index) == (30, 30, 3) { spike } else { light };
                wall(&layout, x, y, [light; 3], rng)
            },
        )
    };
    let settings = PrpfSettings::paper();
    let [with, without] = [1e8, 0.5].map(|spike| filter(&make(spike), &settings, 1).image);
    let change = |i: usize| (with.data()[i] / without.data()[i] - 1.0).abs();
    let pixels = with.pixels();
    let worst = (0..pixels).filter(|&i| i != 30 * 60 + 30).map(change).fold(0.0, f32::max);
    assert!(worst < 0.05, "{worst}");
    assert!(change(30 * 60 + 30) < 0.05, "{}", change(30 * 60 + 30));
}

#[test]
fn the_image_does_not_depend_on_the_number_of_threads() {
    let store = noisy_wall(50, 37, 1.0, |x, _| 2 + x as u32 % 9);
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
        pool.install(|| filter(&store, &PrpfSettings::paper(), 7))
    });
    assert_eq!(one.image, two.image);
    assert_eq!(one.error, two.error);
    assert_eq!(one.interpolation, two.interpolation);
}

#[test]
fn a_store_without_reservoirs_is_filtered() {
    let layout = everything();
    let mut store = Store::new(30, 30, layout.clone(), 0, 1);
    let mut rng = rand_pcg::Pcg32::new(1, 1);
    for (x, y) in (0..30).flat_map(|y| (0..30).map(move |x| (x, y))) {
        store.push(x, y, &wall(&layout, x, y, [1.0; 3], &mut rng));
    }
    assert_finite(&filter(&store, &PrpfSettings::paper(), 1));
}

/// The normalisation scale of the darkest images would exceed `f32`.
#[test]
fn the_darkest_images_are_finite() {
    for radiance in [1e-45, 1e-40, 1e-36, 1e-30] {
        let store = noisy_wall(12, 9, radiance, |_, _| 4);
        assert_finite(&filter(&store, &PrpfSettings::paper(), 1));
    }
}

#[test]
fn a_scene_without_random_dimensions_is_filtered() {
    let layout = Layout::with_blocks(|block| matches!(block, Block::Position1));
    let store =
        store(30, 30, layout.clone(), |_, _| 4, |x, y, _, rng| wall(&layout, x, y, [rng.random(); 3], rng));
    assert_finite(&filter(&store, &PrpfSettings::paper(), 1));
}

#[test]
fn feature_weights_have_names_and_with_few_samples_the_defaults() {
    let layout = everything();
    let store =
        store(3, 2, layout.clone(), |_, _| 2, |x, y, _, rng| wall(&layout, x, y, [rng.random(); 3], rng));
    let (names, planes) = feature_weights(&store, &PrpfSettings::paper(), 1);
    assert_eq!(names.len(), 15 + 4 + 1);
    assert_eq!(
        [&names[0], &names[14], &names[18], &names[19]],
        ["beta P1.x", "beta N2.z", "randomness", "interpolation"]
    );
    assert_eq!(planes.len(), 4);
    for planes in planes {
        assert_eq!((planes.width(), planes.height(), planes.count()), (3, 2, 20));
        // With 12 samples features have equal weights, colours none, and 7 of 9 dimensions are random. At the node:
        let node = |k: usize| planes.at(k, 2, 1);
        assert!((0..15).all(|k| (node(k) - 1.0 / 15.0).abs() < 1e-6));
        assert_eq!([15, 16, 17].map(node), [0.0; 3]);
        assert!((node(18) - 7.0 / 9.0).abs() < 1e-6 && node(19) == f32::INFINITY);
    }
}
