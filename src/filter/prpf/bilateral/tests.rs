//! The vectorised filter against its definition.

use rand::RngExt;

use super::*;
use crate::filter::common::colours::Colours;
use crate::filter::prpf::settings::PrpfSettings;
use crate::filter::synthetic::{store, wall};
use crate::stats::{Block, Layout};

/// The definition of the filter at one pixel, in double precision.
fn filter_pixel(
    values: &InterleavedPlanes,
    guide: &FeatureGuide,
    bandwidths: &InterleavedPlanes,
    deviation: f64,
    [radius, row_step]: [usize; 2],
    (x, y): (usize, usize),
) -> [f64; CHANNELS] {
    let (mut sums, mut total) = ([0.0; CHANNELS], 0.0);
    for yj in y.saturating_sub(radius)..=(y + radius).min(guide.height() - 1) {
        for xj in x.saturating_sub(radius)..=(x + radius).min(guide.width() - 1) {
            if !guide.is_similar((x, y), (xj, yj)) || y.abs_diff(yj) % row_step != 0 {
                continue;
            }
            let squared = x.abs_diff(xj).pow(2) + y.abs_diff(yj).pow(2);
            let mut exponent = squared as f64 / (2.0 * deviation * deviation);
            for k in 0..guide.features() + 3 {
                let d = f64::from(guide.means.at(k, x, y)) - f64::from(guide.means.at(k, xj, yj));
                exponent += f64::from(bandwidths.at(k, x, y)) * d * d;
            }
            let weight = (-exponent).exp();
            total += weight;
            for (c, sum) in sums.iter_mut().enumerate() {
                *sum += weight * f64::from(values.at(c, xj, yj));
            }
        }
    }
    sums.map(|sum| sum / total)
}

#[test]
fn filtered_pixels_agree_with_the_definition() {
    let layout = Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Albedo | Block::Hit));
    let count = |x: usize, y: usize| 2 + (x * y) as u32 % 30;
    let store = store(37, 22, layout.clone(), count, |x, y, _, rng| {
        let mut sample = wall(&layout, x, y, [rng.random(), rng.random(), 1.0], rng);
        let albedo = [0.5, 0.5 + 0.2 * rng.random::<f32>(), (x / 9) as f32];
        layout.write(&mut sample, Block::Albedo, &albedo);
        layout.write(&mut sample, Block::Hit, &[f32::from(y > 4)]);
        sample
    });
    let settings = PrpfSettings::paper();
    let colours = Colours::new(&store, &settings.fireflies);
    let guide = FeatureGuide::new(&store, colours.guide(), &settings);
    let values = colours.values(settings.margin());
    // Reading of Eq. 4, window, whether every second row is left out, spatial deviation, radius
    for (bandwidth, window, alternates, deviation, radius) in [
        (Bandwidth::RpfSigma { sigma8_squared: 0.02 }, 17, false, 17.0 / 4.0, 8),
        (Bandwidth::RpfSigma { sigma8_squared: 0.02 }, 55, false, 55.0 / 4.0, 27),
        (Bandwidth::RpfSigma { sigma8_squared: 0.02 }, 35, true, 35.0 / 4.0, 17),
        (Bandwidth::Literal, 35, false, 35.0 / 12.0, 10),
        (Bandwidth::MeanVariance { kappa: 8.0, rho: 1e-3 }, 35, false, 35.0 / 12.0, 10),
    ] {
        let alternate_rows_from = if alternates { window } else { window + 1 };
        let settings = PrpfSettings { bandwidth, alternate_rows_from, ..settings.clone() };
        let neighbourhood = Neighbourhood::new(&guide, window, 9);
        // α, β and W_c^r.
        let weights = InterleavedPlanes::new(37, 22, guide.features() + 4, 0, 0.3);
        let bandwidths = inverse_bandwidths(&guide, &neighbourhood, &weights, bandwidth);
        let filtered = filter(&values, &guide, &neighbourhood, &weights, window, &settings);
        for (x, y) in (0..22).flat_map(|y| (0..37).map(move |x| (x, y))) {
            let expected = filter_pixel(
                &values,
                &guide,
                &bandwidths,
                deviation,
                [radius, 1 + usize::from(alternates)],
                (x, y),
            );
            for (c, expected) in expected.into_iter().enumerate() {
                let found = f64::from(filtered.at(c, x, y));
                assert!((found - expected).abs() < 2e-5, "({x}, {y}) {c}: {found} for {expected}");
            }
        }
    }
}
