//! Clusters, pooled variances and thresholds against their definitions.

use rand::RngExt;

use super::*;
use crate::filter::common::colours::Colours;
use crate::filter::synthetic::{store, wall};
use crate::stats::Layout;

/// A noisy wall with a constant, a noisy and a striped albedo.
pub(in crate::filter::prpf) fn noisy(
    width: usize,
    height: usize,
    count: impl Fn(usize, usize) -> u32 + Sync,
) -> (Store, FeatureGuide) {
    let layout = Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Albedo | Block::Hit));
    let store = store(width, height, layout.clone(), count, |x, y, _, rng| {
        let mut sample = wall(&layout, x, y, [rng.random(), rng.random(), x as f32 / 10.0], rng);
        let albedo = [0.5, 0.5 + 0.2 * rng.random::<f32>(), (y / 4) as f32];
        layout.write(&mut sample, Block::Albedo, &albedo);
        sample
    });
    let settings = PrpfSettings::paper();
    let colours = Colours::new(&store, &settings.fireflies);
    let guide = FeatureGuide::new(&store, colours.guide(), &settings);
    (store, guide)
}

#[test]
fn a_cluster_holds_exactly_the_similar_pixels() {
    let (_, guide) = noisy(40, 21, |x, _| u32::from(x != 3) * 4);
    let mut cluster = Vec::new();
    guide.cluster(5, 9, 7, &mut cluster);
    // Rows 8 to 11 have the pixel's albedo; column 3 has no samples.
    let expected: Vec<_> = (8..12).flat_map(|y| [2, 4, 5, 6, 7, 8].map(|x| (x, y))).collect();
    assert_eq!(cluster, expected);
    assert!(guide.is_similar((5, 9), (6, 11)) && !guide.is_similar((5, 9), (5, 12)));
    // A pixel without samples is similar to all pixels with samples.
    guide.cluster(3, 9, 3, &mut cluster);
    assert_eq!(cluster.len(), 6);
}

#[test]
fn pooled_variances_are_those_of_the_samples_even_at_one_sample_per_pixel() {
    for n in [1, 2, 8] {
        let (_, guide) = noisy(40, 40, |_, _| n);
        // Uniform in [0, 1).
        let red = guide.features();
        let mean = (0..40).flat_map(|y| guide.variances.row(red, y)).sum::<f32>() / 1600.0;
        assert!((mean * 12.0 - 1.0).abs() < 0.15, "{n}: {mean}");
    }
}

#[test]
fn thresholds_are_standard_deviations_with_an_absolute_minimum() {
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
            assert_eq!((guide.hit.at(0, x, y), guide.own_hit.at(0, x, y)), (FeatureGuide::NO_PIXEL, 0.5));
            assert_eq!(guide.means.at(albedo, x, y), 0.5, "that of its neighbours");
            continue;
        }
        assert_eq!((guide.hit.at(0, x, y), guide.own_hit.at(0, x, y)), (1.0, 1.0));
        assert_eq!(guide.counts.at(0, x, y), 4.0);
        // World positions: 30 standard deviations, or 0.001 if the standard deviation is below that
        let v = guide.variances.at(0, x, y);
        let least = if v <= 1e-6 { 1e-6 } else { 0.0 };
        assert!((at(0) / (900.0 * v).max(least) - 1.0).abs() < 1e-5, "{x} {y}");
        // Albedos: one is constant, one has a standard deviation of 0.06, three of which exceed 0.1
        assert!((at(albedo) - 0.01).abs() < 1e-8);
        let v = guide.variances.at(albedo + 1, x, y);
        assert!((at(albedo + 1) - (9.0 * v).max(0.01)).abs() < 1e-5);
    }
    assert!(guide.z[..3] == [30.0; 3] && guide.z[albedo] == 3.0);
}
