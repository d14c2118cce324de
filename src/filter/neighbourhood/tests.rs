//! Clusters, pooled variances, thresholds and statistics against all samples.

use rand::RngExt;

use super::super::colours::Colours;
use super::super::synthetic::{store, wall};
use super::*;
use crate::stats::Layout;

fn noisy(width: usize, height: usize, count: impl Fn(usize, usize) -> u32 + Sync) -> (Store, Guide) {
    let layout = Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Albedo | Block::Hit));
    let store = store(width, height, layout.clone(), count, |x, y, _, rng| {
        let mut sample = wall(&layout, x, y, [rng.random(), rng.random(), x as f32 / 10.0], rng);
        let albedo = [0.5, 0.5 + 0.2 * rng.random::<f32>(), (y / 4) as f32];
        layout.write(&mut sample, Block::Albedo, &albedo);
        sample
    });
    let settings = PrpfSettings::paper();
    let colours = Colours::new(&store, &settings.outliers);
    let guide = Guide::new(&store, colours.guide(), &settings);
    (store, guide)
}

#[test]
fn statistics_are_those_of_all_samples_of_the_cluster() {
    let (store, guide) = noisy(21, 19, |_, _| 8);
    let neighbourhood = Neighbourhood::new(&guide, 7, usize::MAX);
    let dims = store.layout().len();
    let mut cluster = Vec::new();
    for (x, y) in [(0, 0), (10, 9), (20, 18), (16, 3)] {
        guide.cluster(x, y, 7, &mut cluster);
        for (k, &dim) in guide.feature_dims().iter().enumerate() {
            let values: Vec<f64> = cluster
                .iter()
                .flat_map(|&(x, y)| store.rows()[y as usize].reservoir(x as usize).chunks(dims))
                .map(|sample| f64::from(sample[dim]))
                .collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
            let found = (neighbourhood.mean(k, x, y), neighbourhood.variance(k, x, y));
            assert!((f64::from(found.0) - mean).abs() < 1e-6 * (1.0 + mean.abs()), "{found:?} {mean}");
            assert!((f64::from(found.1) - variance).abs() < 1e-5 * variance + 1e-9, "{found:?} {variance}");
        }
    }
}

#[test]
fn a_cluster_holds_the_pixels_that_resemble_and_no_others() {
    let (_, guide) = noisy(40, 21, |x, _| u32::from(x != 3) * 4);
    let mut cluster = Vec::new();
    guide.cluster(5, 9, 7, &mut cluster);
    // Rows 8 to 11 have the pixel's albedo; column 3 has no samples.
    let expected: Vec<_> = (8..12).flat_map(|y| [2, 4, 5, 6, 7, 8].map(|x| (x, y))).collect();
    assert_eq!(cluster, expected);
    assert!(guide.resembles((5, 9), (6, 11)) && !guide.resembles((5, 9), (5, 12)));
    // A pixel without samples takes all that have some.
    guide.cluster(3, 9, 3, &mut cluster);
    assert_eq!(cluster.len(), 6);
}

#[test]
fn few_looked_at_pixels_give_nearly_the_deviation_of_all() {
    let (_, guide) = noisy(64, 64, |_, _| 8);
    let [all, few] = [usize::MAX, 9].map(|side| Neighbourhood::new(&guide, 55, side));
    for k in [0, 4, guide.features()] {
        let [all, few] = [&all, &few].map(|hood| hood.variance(k, 32, 32).sqrt());
        assert!((few / all - 1.0).abs() < 0.2, "{k}: {few} for {all}");
    }
}

#[test]
fn offsets_reach_from_end_to_end_of_the_window() {
    assert_eq!(offsets(55, 9), [-27, -20, -14, -7, 0, 7, 14, 20, 27]);
    assert_eq!(offsets(7, 9), [-3, -2, -1, 0, 1, 2, 3]);
    assert_eq!(offsets(1, 9), [0]);
    assert_eq!(offsets(55, 1), [0]);
}

#[test]
fn pooling_finds_the_deviation_even_where_pixels_have_one_sample() {
    for n in [1, 2, 8] {
        let (_, guide) = noisy(40, 40, |_, _| n);
        // Uniform in [0, 1).
        let red = guide.features();
        let mean = (0..40).flat_map(|y| guide.variances.row(red, y)).sum::<f32>() / 1600.0;
        assert!((mean * 12.0 - 1.0).abs() < 0.15, "{n}: {mean}");
    }
}

#[test]
fn variances_are_pooled_with_the_neighbours_by_their_samples() {
    let (width, height) = (7, 5);
    let number = |i: usize, by: usize| (i * by % 13) as f32;
    let means: Vec<f32> = (0..35).map(|i| number(i, 5)).collect();
    let counts: Vec<u32> =
        (0..35).map(|i| if i % 7 < 3 { [1, 0][i % 2] } else { [2, 5, 1][i % 3] }).collect();
    let variances: Vec<f32> = (0..35).map(|i| if counts[i] > 1 { 1.0 + number(i, 3) } else { 0.0 }).collect();
    let mut pooled = vec![0.0; 35];
    pool(&mut pooled, &means, &variances, &counts, width);
    for i in 0..35 {
        let near: Vec<usize> = (0..35)
            .filter(|j| (j % width).abs_diff(i % width) <= 1 && (j / width).abs_diff(i / width) <= 1)
            .collect();
        let mean = |of: Vec<f32>| of.iter().sum::<f32>() / of.len().max(1) as f32;
        let known: Vec<f32> = near.iter().filter(|&&j| counts[j] > 1).map(|&j| variances[j]).collect();
        let single = near.iter().filter(|&&j| j != i && counts[j] == 1);
        let pairs: Vec<f32> = single.map(|&j| (means[j] - means[i]).powi(2) / 2.0).collect();
        let pool = if !known.is_empty() {
            mean(known)
        } else if counts[i] > 0 {
            mean(pairs)
        } else {
            0.0
        };
        let own = counts[i].saturating_sub(1) as f32;
        let expected = (2.0 * pool + own * variances[i]) / (2.0 + own);
        assert!((pooled[i] - expected).abs() < 1e-4, "{i}: {} for {expected}", pooled[i]);
    }
    assert_eq!(height * width, 35);
}

#[test]
fn thresholds_are_the_deviations_that_are_set_and_what_hardly_varies_may_always_be_a_little_apart() {
    let (store, guide) = noisy(12, 9, |x, y| if (x, y) == (5, 4) { 0 } else { 4 });
    let albedo = guide
        .feature_dims()
        .iter()
        .position(|&dim| store.layout().block(Block::Albedo).is_some_and(|b| b.start == dim));
    let albedo = albedo.expect("a feature");
    for (x, y) in (0..9).flat_map(|y| (0..12).map(move |x| (x, y))) {
        let at = |k: usize| guide.thresholds.at(k, x, y);
        if (x, y) == (5, 4) {
            assert!((0..guide.features()).all(|k| at(k) == f32::INFINITY));
            assert_eq!((guide.hit.at(0, x, y), guide.own_hit.at(0, x, y)), (Guide::NOTHING, 0.5));
            assert_eq!(guide.means.at(albedo, x, y), 0.0);
            continue;
        }
        assert_eq!((guide.hit.at(0, x, y), guide.own_hit.at(0, x, y)), (1.0, 1.0));
        assert_eq!(guide.counts.at(0, x, y), 4.0);
        // World positions: 30 deviations, or 0.001 where they vary less than that.
        let v = guide.variances.at(0, x, y);
        let least = if v <= 1e-6 { 1e-6 } else { 0.0 };
        assert!((at(0) / (900.0 * v).max(least) - 1.0).abs() < 1e-5, "{x} {y}");
        // Albedos: one constant, one of deviation 0.06 with 3 of which it is further apart than 0.1.
        assert!((at(albedo) - 0.01).abs() < 1e-8);
        let v = guide.variances.at(albedo + 1, x, y);
        assert!((at(albedo + 1) - (9.0 * v).max(0.01)).abs() < 1e-5);
    }
    assert!(guide.tolerances[..3] == [30.0; 3] && guide.tolerances[albedo] == 3.0);
}
