//! Statistics against those of all samples of the cluster.

use super::super::feature_guide::tests::noisy;
use super::*;

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
fn a_subset_of_the_window_gives_nearly_the_deviation_of_all() {
    let (_, guide) = noisy(64, 64, |_, _| 8);
    let [all, few] = [usize::MAX, 9].map(|side| Neighbourhood::new(&guide, 55, side));
    for k in [0, 4, guide.features()] {
        let [all, few] = [&all, &few].map(|neighbourhood| neighbourhood.variance(k, 32, 32).sqrt());
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
