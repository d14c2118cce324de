//! Interpolation against its definition.

use rand::RngExt;

use super::*;
use crate::filter::common::colours::Colours;
use crate::filter::prpf::reservoirs::Reservoirs;
use crate::filter::synthetic::{store, wall};
use crate::stats::{Block, Layout};

#[test]
fn interpolation_is_the_joint_bilateral_mean_of_the_surrounding_nodes() {
    // Prepare a noisy wall. The last node of each axis lies at the centre of its cell
    let (width, height, window) = (23, 18, 17);
    let layout = Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Albedo | Block::Hit));
    let store = store(
        width,
        height,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng| {
            let mut sample = wall(&layout, x, y, [rng.random(), 1.0, 0.1 * x as f32], rng);
            let noise = 0.5 * rng.random::<f32>();
            layout.write(&mut sample, Block::Albedo, &[0.5, 0.3 + noise, 0.1 * y as f32 + noise]);
            layout.write(&mut sample, Block::Hit, &[f32::from(y > 4)]);
            sample
        },
    );
    let settings = PrpfSettings::paper();
    let guide = FeatureGuide::new(&store, Colours::new(&store, &settings.fireflies).guide(), &settings);
    let neighbourhood = Neighbourhood::new(&guide, window, 9);
    let grid = Grid::new(width, height, 5);
    let values: Vec<f32> = (0..2 * grid.nodes().len()).map(|i| (i * 29 % 17) as f32).collect();

    // Interpolate arbitrary values
    let mut found = InterleavedPlanes::new(width, height, 3, 0, 0.0);
    interpolate(&guide, &neighbourhood, window, &grid, &values, &mut found);

    // Compare each pixel with the definition
    let axis = |size: usize| (2..size).step_by(5).collect::<Vec<_>>();
    let (xs, ys) = (axis(width), axis(height));
    let around = |nodes: &[usize], at: usize| {
        let before = nodes.iter().filter(|&&node| node <= at).count();
        before.saturating_sub(2)..(before + 2).min(nodes.len())
    };
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (mut sums, mut total) = ([0.0; 2], 0.0);
        for (i, j) in around(&ys, y).flat_map(|j| around(&xs, x).map(move |i| (i, j))) {
            let (xn, yn) = (xs[i], ys[j]);
            if (guide.own_hit.at(0, x, y) - guide.hit.at(0, xn, yn)).abs() > 0.5 {
                continue;
            }
            let squared = (x.abs_diff(xn).pow(2) + y.abs_diff(yn).pow(2)) as f64;
            let mut exponent = 12.0 * squared / (window * window) as f64;
            for k in 0..guide.features() + 3 {
                let own = f64::from(guide.means.at(k, x, y));
                let around = f64::from(neighbourhood.variance(k, x, y));
                let variance = if k < guide.features() {
                    let z = f64::from(guide.z[k]);
                    z * z * f64::from(guide.variances.at(k, x, y)) + 1e-4 * around
                } else {
                    around + 1e-8 * own * own
                };
                exponent += (f64::from(guide.means.at(k, xn, yn)) - own).powi(2) / (variance + 1e-12);
            }
            let weight = (-exponent / 2.0).exp();
            total += weight;
            let node = j * xs.len() + i;
            sums[0] += weight * f64::from(values[2 * node]);
            sums[1] += weight * f64::from(values[2 * node + 1]);
        }
        let sum = f64::from(found.at(2, x, y));
        assert!((sum - total).abs() < 1e-3 * total + 1e-30, "{x} {y}: {sum} for {total}");
        for (k, expected) in sums.into_iter().enumerate().filter(|_| total > 1e-20) {
            let (value, expected) = (f64::from(found.at(k, x, y)), expected / total);
            assert!((value - expected).abs() < 2e-2, "{x} {y} {k}: {value} for {expected}");
        }
    }
}

#[test]
fn of_a_block_in_which_interpolation_failed_similar_pixels_share_their_weights() {
    // An edge between columns 2 and 3 divides every second block
    let layout = Layout::with_blocks(|b| matches!(b, Block::Albedo));
    let store = store(
        8,
        4,
        layout.clone(),
        |_, _| 8,
        |x, y, _, rng| {
            let mut sample = wall(&layout, x, y, [0.5 + 0.1 * rng.random::<f32>(); 3], rng);
            layout.write(&mut sample, Block::Albedo, &[if x < 3 { 0.2 } else { 0.8 }; 3]);
            sample
        },
    );
    let settings = PrpfSettings::paper();
    let guide = &FeatureGuide::new(&store, Colours::new(&store, &settings.fireflies).guide(), &settings);
    let neighbourhood = &Neighbourhood::new(guide, 17, 9);
    let inputs = WeightInputs {
        store: &store,
        reservoirs: &Reservoirs::new(&store),
        guide,
        neighbourhood,
        normalisation_scale: 1.0,
        settings: &settings,
        pass: 0,
        window: 17,
        seed: 0,
    };
    let failed = Failed::new(&inputs, (0..32).map(|i| (i % 8, i / 8)));
    let expected: Vec<_> = [0, 2].iter().flat_map(|&y| [(0, y), (2, y), (3, y), (4, y), (6, y)]).collect();
    let direct: Vec<_> = failed.direct.iter().copied().filter(|&(_, y)| y % 2 == 0).collect();
    assert_eq!(direct, expected);
    for (to, from) in &failed.copies {
        assert_eq!((to.0 / 2, to.1 / 2), (from.0 / 2, from.1 / 2), "one block");
        assert_eq!(to.0 < 3, from.0 < 3, "one side of the edge");
    }
    assert_eq!(failed.direct.len() + failed.copies.len(), 32);
}
