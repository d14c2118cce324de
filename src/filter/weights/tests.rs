//! Weights of dimensions whose dependence is known, and what they are measured on.

use rand::RngExt;

use super::super::colours::Colours;
use super::super::synthetic::{store, wall};
use super::*;
use crate::stats::Block;

const LENS: usize = 0;
const ALBEDO: usize = 3;

/// Weights at the centre of a wall whose albedo alone makes its colour and whose normal is
/// nothing but the lens sample and the time: β of normal and albedo, α, W_c^r.
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

/// The weights at the centre, in the first pass. Normals within `tolerance` resemble each other.
fn evaluate(store: &Store, tolerance: f32) -> Vec<f32> {
    let settings = PrpfSettings { tolerance, ..PrpfSettings::paper() };
    let colours = Colours::new(store, &settings.outliers);
    let guide = Guide::new(store, colours.guide(), &settings);
    let evidence = Evidence {
        store,
        guide: &guide,
        neighbourhood: &Neighbourhood::new(&guide, 55, 9),
        exposure: colours.exposure(),
        settings: &settings,
        pass: 0,
        window: 55,
        seed: 3,
    };
    let mut weights = vec![0.0; evidence.len()];
    evidence.evaluate((28, 28), &mut Scratch::new(&evidence), &mut weights);
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
fn features_that_follow_position_and_explain_the_colour_get_the_weight_and_noise_gets_none() {
    // Not all of it: the position explains the colour as well as either of two features.
    check(|x, _| 0.1 + 0.01 * x as f32, 0.6);
}

#[test]
fn features_without_relation_to_one_coordinate_keep_the_weight_that_null_information_leaves() {
    // Neither x nor y alone says anything on a random pattern, so that of the information on
    // it, all of it chance, 3 parts in 5 belong to the 3 random parameters: 1 - W = 0.4.
    check(|x, y| 0.2 + 0.1 * ((x * x * 7 + y * y * 13 + x * y * 5) % 7) as f32, 0.3);
}

#[test]
fn noise_in_the_colour_takes_its_weight() {
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

#[test]
fn copies_are_whole_at_any_length() {
    for n in 0..=LANES {
        let sample: Vec<f32> = (0..n).map(|i| i as f32).collect();
        let mut to = [-1.0; LANES];
        copy(&sample, &mut to);
        assert_eq!(to[..n], sample);
        assert!(to[n..].iter().all(|&v| v == -1.0));
    }
}

/// What weights at a pixel are made from, its cluster found.
fn with_evidence<T>(
    store: &Store,
    settings: &PrpfSettings,
    window: usize,
    at: (usize, usize),
    make: impl for<'a> FnOnce(&Evidence<'a>, &mut Scratch<'a>) -> T,
) -> T {
    let colours = Colours::new(store, &settings.outliers);
    let guide = Guide::new(store, colours.guide(), settings);
    let neighbourhood = Neighbourhood::new(&guide, window, 9);
    let evidence = Evidence {
        store,
        guide: &guide,
        neighbourhood: &neighbourhood,
        exposure: colours.exposure(),
        settings,
        pass: 1,
        window,
        seed: 3,
    };
    let mut scratch = Scratch::new(&evidence);
    evidence.guide.cluster(at.0, at.1, window, &mut scratch.cluster);
    make(&evidence, &mut scratch)
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
    with_evidence(&store, &PrpfSettings::paper(), 7, at, |evidence, scratch| {
        let found = evidence.standard(at, scratch);
        let cluster = &scratch.cluster;
        let n = cluster.len() as f32;
        // Columns 4 to 7 have the pixel's albedo, rows 0 to 5 are in the window.
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
        let colours = layout.colour().map(|dim| (dim, evidence.exposure));
        for (k, (dim, exposure)) in dims.chain(colours).enumerate() {
            let mean = evidence.neighbourhood.mean(k, at.0, at.1) / exposure;
            let deviation = evidence.neighbourhood.variance(k, at.0, at.1).sqrt() / exposure;
            assert!((found.mean[dim] - mean).abs() < 1e-5 * mean.abs());
            // Two albedos, green and blue are constant.
            let varies = [1, 3].contains(&k);
            let scale = if varies { 1.0 / deviation } else { 0.0 };
            assert!((found.scale[dim] - scale).abs() <= 1e-5 * scale, "{k}: {}", found.scale[dim]);
        }
    });
}

#[test]
fn samples_are_as_many_as_are_wanted_or_there() {
    let layout = Layout::with_blocks(|b| matches!(b, Block::Lens));
    let made = |side: usize, count: u32| {
        store(
            side,
            side,
            layout.clone(),
            move |_, _| count,
            |x, y, _, rng| wall(&layout, x, y, [0.5; 3], rng),
        )
    };
    // A pixel keeps 8 samples at most.
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
        let taken = with_evidence(&made(side, count), &settings, 55, at, |evidence, scratch| {
            let standard = evidence.standard(at, scratch);
            evidence.gather(at, &standard, scratch)
        });
        assert_eq!(taken, expected, "{side} {count} {wanted}");
    }

    // Of a store that keeps none, none, however many are wanted of a larger cluster.
    let mut none = Store::new(9, 9, layout.clone(), 0, 1);
    let mut rng = rand_pcg::Pcg32::new(1, 1);
    (0..81).for_each(|i| none.push(i % 9, i / 9, &wall(&layout, i % 9, i / 9, [0.5; 3], &mut rng)));
    let settings = PrpfSettings { mi_samples: 20, ..PrpfSettings::paper() };
    let taken = with_evidence(&none, &settings, 55, (4, 4), |evidence, scratch| {
        let standard = evidence.standard((4, 4), scratch);
        evidence.gather((4, 4), &standard, scratch)
    });
    assert_eq!(taken, 0);
}

/// Any program may fill a store: shares of hits beyond 1 must not make pixels without samples alike.
#[test]
fn shares_of_hits_that_no_renderer_makes_leave_pixels_without_samples_out() {
    let layout = Layout::with_blocks(|block| block == Block::Hit);
    let mut store = Store::new(24, 24, layout.clone(), 8, 1);
    let mut sample = vec![0.5; layout.len()];
    layout.write(&mut sample, Block::Hit, &[4.0]);
    for i in (0..24 * 24).filter(|i| i % 3 > 0) {
        (0..8).for_each(|_| store.push(i % 24, i / 24, &sample));
    }
    let settings = PrpfSettings { mi_samples: 64, ..PrpfSettings::paper() };
    let taken = with_evidence(&store, &settings, 55, (13, 12), |evidence, scratch| {
        let standard = evidence.standard((13, 12), scratch);
        evidence.gather((13, 12), &standard, scratch)
    });
    assert_eq!(taken, 64);
}
