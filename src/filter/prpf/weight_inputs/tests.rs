//! Weights of dimensions with known dependence, and the samples they are estimated from.

use rand::RngExt;

use super::*;
use crate::filter::common::colours::Colours;
use crate::filter::synthetic::{store, wall};
use crate::stats::{Block, Layout};

const LENS: usize = 0;
const ALBEDO: usize = 3;

/// Returns the weights at the centre of a wall whose colour depends on the albedo only, and whose normal is
/// made of the lens sample and the time: β of normal and albedo, α, W_c^r.
fn weights(
    count: impl Fn(usize, usize) -> u32 + Sync,
    albedo: impl Fn(usize, usize) -> f32 + Sync,
) -> Vec<f32> {
    use Block::{Albedo, Hit, Lens, Normal1, Time};
    let layout = Layout::with_blocks(|b| matches!(b, Normal1 | Albedo | Lens | Time | Hit));
    let randoms = layout.randoms();
    let store = store(56, 56, layout.clone(), count, |x, y, _, rng| {
        let albedo = albedo(x, y);
        let mut sample = wall(&layout, x, y, [albedo, 0.5 * albedo, 0.2], rng);
        let normal = [0, 1, 2].map(|k| sample[randoms[k]]);
        layout.write(&mut sample, Normal1, &normal);
        layout.write(&mut sample, Albedo, &[albedo, albedo, 0.2]);
        sample
    });
    evaluate(&store, 10.0)
}

/// Returns the weights at the centre in the first pass. Normals within `min_threshold` are similar.
fn evaluate(store: &Store, min_threshold: f32) -> Vec<f32> {
    let settings = PrpfSettings { min_threshold, ..PrpfSettings::paper() };
    let colours = Colours::new(store, &settings.fireflies);
    let guide = FeatureGuide::new(store, colours.guide(), &settings);
    let inputs = WeightInputs {
        store,
        reservoirs: &Reservoirs::new(store),
        guide: &guide,
        neighbourhood: &Neighbourhood::new(&guide, 55, 9),
        normalisation_scale: colours.normalisation_scale(),
        settings: &settings,
        pass: 0,
        window: 55,
        seed: 3,
    };
    let mut weights = vec![0.0; inputs.len()];
    inputs.evaluate((28, 28), &mut Scratch::new(&inputs), &mut weights);
    weights
}

fn uneven(x: usize, y: usize) -> u32 {
    1 + (x * 31 + y * 17) as u32 % 64
}

fn check(albedo: impl Fn(usize, usize) -> f32 + Sync + Copy, least: f32) {
    for (name, weights) in [
        ("8", weights(|_, _| 8, albedo)),
        ("64", weights(|_, _| 64, albedo)),
        ("uneven", weights(uneven, albedo)),
    ] {
        let noise: f32 = weights[LENS..LENS + 3].iter().sum();
        let explaining: f32 = weights[ALBEDO..ALBEDO + 2].iter().sum();
        assert!(noise < 0.01, "{name}: {weights:?}");
        assert!(explaining > least, "{name}: {weights:?}");
        assert_eq!(weights[ALBEDO + 2], 0.0, "a constant feature");
    }
}

#[test]
fn features_that_explain_the_colour_get_the_weight_and_noise_gets_none() {
    // The position explains the colour as well as either of two features, and takes its part of the weight.
    check(|x, _| 0.1 + 0.01 * x as f32, 0.6);
}

#[test]
fn features_independent_of_each_coordinate_keep_the_weight_of_null_information() {
    // A random pattern depends on neither x nor y alone. All information on it is bias, 3/5 of which belong
    // to the 3 random parameters: 1 - W = 0.4.
    check(|x, y| 0.2 + 0.1 * ((x * x * 7 + y * y * 13 + x * y * 5) % 7) as f32, 0.3);
}

#[test]
fn noisy_colours_get_no_weight() {
    use Block::{Lens, Normal1};
    let layout = Layout::with_blocks(|b| matches!(b, Normal1 | Lens));
    let lens = layout.randoms()[0];
    let store = store(
        56,
        56,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng| {
            let sample = wall(&layout, x, y, [0.0; 3], rng);
            let light = sample[lens];
            let mut sample = sample;
            layout.write(&mut sample, Block::Colour, &[light, light, x as f32 / 56.0]);
            sample
        },
    );
    let [.., red, green, blue, randomness] = evaluate(&store, 0.1)[..] else { panic!("four at least") };
    assert_eq!([red, green], [0.0; 2]);
    assert!(blue > 0.9, "{blue}");
    assert!((randomness - 2.0 / 3.0).abs() < 0.05, "{randomness}");
}

/// Prepares the inputs of the weights at a pixel and finds its cluster.
fn with_inputs<T>(
    store: &Store,
    settings: &PrpfSettings,
    window: usize,
    at: (usize, usize),
    make: impl for<'a> FnOnce(&WeightInputs<'a>, &mut Scratch<'a>) -> T,
) -> T {
    let colours = Colours::new(store, &settings.fireflies);
    let guide = FeatureGuide::new(store, colours.guide(), settings);
    let neighbourhood = Neighbourhood::new(&guide, window, 9);
    let inputs = WeightInputs {
        store,
        reservoirs: &Reservoirs::new(store),
        guide: &guide,
        neighbourhood: &neighbourhood,
        normalisation_scale: colours.normalisation_scale(),
        settings,
        pass: 1,
        window,
        seed: 3,
    };
    let mut scratch = Scratch::new(&inputs);
    inputs.guide.cluster(at.0, at.1, window, &mut scratch.cluster);
    make(&inputs, &mut scratch)
}

#[test]
fn samples_are_standardised_by_the_cluster() {
    let layout = Layout::with_blocks(|b| matches!(b, Block::Albedo | Block::Lens));
    let store = store(
        12,
        9,
        layout.clone(),
        |_, _| 8,
        |x, y, index, rng| {
            let mut sample = wall(&layout, x, y, [4.0 * rng.random::<f32>(), 0.3, 40.0], rng);
            layout.write(&mut sample, Block::Albedo, &[0.5, 0.01 * (index % 2) as f32, (x / 4) as f32]);
            sample
        },
    );
    let at = (5, 2);
    with_inputs(&store, &PrpfSettings::paper(), 7, at, |inputs, scratch| {
        let found = inputs.standardisation(at, scratch);
        let cluster = &scratch.cluster;
        let n = cluster.len() as f32;
        // Columns 4 to 7 have the pixel's albedo, rows 0 to 5 lie in the window
        assert_eq!(n, 24.0);
        for (axis, dim) in layout.film().enumerate() {
            let coordinate = |&(x, y): &(u32, u32)| [x, y][axis] as f32;
            let mean = cluster.iter().map(coordinate).sum::<f32>() / n;
            let variance = cluster.iter().map(|j| (coordinate(j) - mean).powi(2)).sum::<f32>() / n;
            let own = store.rows()[at.1].moments(at.0, dim, Part::Whole).mean as f32;
            let expected = own + mean - [at.0, at.1][axis] as f32;
            assert!((found.mean[dim] - expected).abs() < 1e-5, "{axis}: {}", found.mean[dim]);
            let scale = 1.0 / (variance + 1.0 / 12.0).sqrt();
            assert!((found.scale[dim] - scale).abs() < 1e-5, "{axis}: {}", found.scale[dim]);
        }
        for dim in layout.randoms() {
            assert_eq!(found.mean[dim], 0.5);
            assert!((found.scale[dim] - 12f32.sqrt()).abs() < 1e-5);
        }
        let dims = layout.features().into_iter().map(|(dim, _)| (dim, 1.0));
        let colours = layout.colour().map(|dim| (dim, inputs.normalisation_scale));
        for (k, (dim, normalisation)) in dims.chain(colours).enumerate() {
            let mean = inputs.neighbourhood.mean(k, at.0, at.1) / normalisation;
            let deviation = inputs.neighbourhood.variance(k, at.0, at.1).sqrt() / normalisation;
            assert!((found.mean[dim] - mean).abs() < 1e-5 * mean.abs());
            // Two albedos, green and blue are constant
            let varies = [1, 3].contains(&k);
            let scale = if varies { 1.0 / deviation } else { 0.0 };
            assert!((found.scale[dim] - scale).abs() <= 1e-5 * scale, "{k}: {}", found.scale[dim]);
        }
    });
}

#[test]
fn samples_are_as_many_as_wanted_or_available() {
    let layout = Layout::with_blocks(|b| matches!(b, Block::Lens));
    let make = |side: usize, count: u32| {
        store(
            side,
            side,
            layout.clone(),
            move |_, _| count,
            |x, y, _, rng| wall(&layout, x, y, [0.5; 3], rng),
        )
    };
    // A reservoir holds 8 samples
    for (side, count, wanted, expected) in [
        (5, 3, 2048, 75),
        (5, 8, 200, 200),
        (5, 8, 40, 40),
        (5, 20, 8, 8),
        (5, 20, 3, 3),
        (40, 20, 2048, 2048),
        (1, 1, 2048, 1),
    ] {
        let settings = PrpfSettings { mi_samples: wanted, ..PrpfSettings::paper() };
        let at = (side / 2, side / 2);
        let taken = with_inputs(&make(side, count), &settings, 55, at, |inputs, scratch| {
            let standardisation = inputs.standardisation(at, scratch);
            inputs.slice_samples(at, &standardisation, scratch)
        });
        assert_eq!(taken, expected, "{side} {count} {wanted}");
    }

    // A store without reservoirs has none
    let mut none = Store::new(9, 9, layout.clone(), 0, 1);
    let mut rng = rand_pcg::Pcg32::new(1, 1);
    (0..81).for_each(|i| none.push(i % 9, i / 9, &wall(&layout, i % 9, i / 9, [0.5; 3], &mut rng)));
    let settings = PrpfSettings { mi_samples: 20, ..PrpfSettings::paper() };
    let taken = with_inputs(&none, &settings, 55, (4, 4), |inputs, scratch| {
        let standardisation = inputs.standardisation((4, 4), scratch);
        inputs.slice_samples((4, 4), &standardisation, scratch)
    });
    assert_eq!(taken, 0);
}

/// Another program may store hit fractions above 1, which must not make pixels without samples similar.
#[test]
fn hit_fractions_above_one_do_not_add_pixels_without_samples_to_clusters() {
    let layout = Layout::with_blocks(|block| block == Block::Hit);
    let mut store = Store::new(24, 24, layout.clone(), 8, 1);
    let mut sample = vec![0.5; layout.len()];
    layout.write(&mut sample, Block::Hit, &[4.0]);
    for i in (0..24 * 24).filter(|i| i % 3 > 0) {
        (0..8).for_each(|_| store.push(i % 24, i / 24, &sample));
    }
    let settings = PrpfSettings { mi_samples: 64, ..PrpfSettings::paper() };
    let taken = with_inputs(&store, &settings, 55, (13, 12), |inputs, scratch| {
        let standardisation = inputs.standardisation((13, 12), scratch);
        inputs.slice_samples((13, 12), &standardisation, scratch)
    });
    assert_eq!(taken, 64);
}

#[test]
fn parts_of_a_cluster_select_every_pixel_equally_often() {
    let mut rng = Pcg32::new(3, 5);
    for (len, parts) in [(289, 248), (3025, 504), (40, 7)] {
        let stratum = Stratum::new(len, parts);
        let mut counts = vec![0; len];
        let rounds = 400 * len / parts;
        for _ in 0..rounds {
            (0..parts).for_each(|s| counts[stratum.element(s as u64, rng.next_u32())] += 1);
        }
        let expected = (rounds * parts) as f64 / len as f64;
        let least = *counts.iter().min().unwrap();
        let most = *counts.iter().max().unwrap();
        // Each is binomial, with a deviation of at most 5 %
        assert!(
            f64::from(least) > 0.7 * expected && f64::from(most) < 1.3 * expected,
            "{least} to {most}, {expected}"
        );
    }
}
