//! Redistribution against its formulas.

use super::super::fireflies::tests::grey_except;
use super::*;

#[test]
fn redistribution_keeps_the_energy_where_no_pixel_reaches_its_limit() {
    let firefly = Firefly { pixel: 40, excess: [0.3, 0.2, 0.1], scale: 0.5, half_scales: [0.5; 2] };
    let (mut image, _) = grey_except([0.5, 0.5]);
    let before: f32 = image.plane(0).iter().sum();
    redistribute(&[firefly], &mut [&mut image], &FireflySettings::default(), |_, _| true);
    let after: f32 = image.plane(0).iter().sum();
    assert!((after - before - 0.3).abs() < 1e-4, "{before} {after}");
    assert!(image.plane(0)[40] > image.plane(0)[0]);
}

#[test]
fn redistribution_respects_the_limit_and_changes_only_similar_pixels() {
    let firefly = Firefly { pixel: 40, excess: [1e8; 3], scale: 0.5, half_scales: [0.5; 2] };
    let (mut image, _) = grey_except([0.5, 0.5]);
    redistribute(&[firefly], &mut [&mut image], &FireflySettings::default(), |_, (x, _)| x < 5);
    assert!(image.data().iter().all(|&v| v < 0.5 * 1.021), "{:?}", image.plane(0));
    assert!(image.plane(0).chunks(9).all(|row| row[5..].iter().all(|&v| v == 0.5)));
}

#[test]
fn redistribution_weights_are_a_gaussian_of_a_quarter_window() {
    let settings =
        FireflySettings { redistribution_window: 5, redistribution_limit: 0.1, ..FireflySettings::default() };
    let fireflies =
        [11, 40].map(|pixel| Firefly { pixel, excess: [0.3, 0.2, 0.1], scale: 0.5, half_scales: [0.5; 2] });
    let is_similar = |_: (usize, usize), (x, y): (usize, usize)| (x + 2 * y) % 3 != 0;
    let (mut image, [mut other, _]) = grey_except([0.5, 0.7]);
    let before = [image.clone(), other.clone()];
    redistribute(&fireflies, &mut [&mut image, &mut other], &settings, is_similar);
    let mut expected = [0.0; 81];
    for firefly in &fireflies {
        let (x, y) = ((firefly.pixel % 9) as f32, (firefly.pixel / 9) as f32);
        let weights: Vec<f32> = (0..81)
            .map(|i| {
                let (dx, dy) = ((i % 9) as f32 - x, (i / 9) as f32 - y);
                let inside = dx.abs() <= 2.0 && dy.abs() <= 2.0;
                let taken = inside && (i == firefly.pixel || is_similar((0, 0), (i % 9, i / 9)));
                if taken { (-(dx * dx + dy * dy) / (2.0 * 1.25 * 1.25)).exp() } else { 0.0 }
            })
            .collect();
        let total: f32 = weights.iter().sum();
        for i in 0..81 {
            let limit = 0.1 * pixel_luminance(&before[0], i) / luminance(firefly.excess);
            expected[i] += (weights[i] / total).min(limit);
        }
    }
    for (after, before) in [&image, &other].into_iter().zip(&before) {
        for (c, excess) in [0.3, 0.2, 0.1].into_iter().enumerate() {
            for (i, expected) in expected.iter().enumerate() {
                let change = after.plane(c)[i] - before.plane(c)[i];
                assert!((change - expected * excess).abs() < 1e-6, "{c} {i}: {change}");
            }
        }
    }
}

#[test]
fn blurred_excess_is_a_gaussian_around_each_firefly_up_to_the_limit() {
    let (sigma, side) = (2.0, 41);
    let at = 20 * side + 20;
    let mut whole = Planes::new(side, side, 3);
    whole.data_mut().fill(0.5);
    let mut divisor = whole.clone();
    divisor.plane_mut(1).fill(0.25);
    for (excess, limit) in [([3.0, 2.0, 1.0], 1.0), ([3e3, 2e3, 1e3], 0.02)] {
        let fireflies = vec![Firefly { pixel: at, excess, scale: 0.5, half_scales: [0.5; 2] }];
        let halves = [whole.clone(), whole.clone()];
        let clamped = FireflyClamp { whole: whole.clone(), halves, fireflies };
        let light = blurred_excess(&clamped, Some(&divisor), sigma, limit).expect("a firefly");
        let mut impulse = vec![0.0; side * side];
        impulse[at] = 1.0;
        let peak = 1.0 / (2.0 * std::f32::consts::PI * sigma * sigma);
        let fraction = (limit * 0.5 / (peak * luminance(excess))).min(1.0);
        for (i, value) in blur::gaussian(side, side, &impulse, sigma).into_iter().enumerate() {
            for (c, divisor) in [0.5, 0.25, 0.5].into_iter().enumerate() {
                let expected = value * fraction * excess[c] / divisor;
                let error = (light.plane(c)[i] - expected).abs();
                assert!(error <= 1e-4 * expected, "{c} {i}: {} for {expected}", light.plane(c)[i]);
            }
        }
        let plain = blurred_excess(&clamped, None, sigma, limit).expect("a firefly");
        assert!((plain.plane(1)[at] - 0.25 * light.plane(1)[at]).abs() <= 1e-5 * light.plane(1)[at]);
    }
    let none = FireflyClamp { halves: [whole.clone(), whole.clone()], whole, fireflies: Vec::new() };
    assert!(blurred_excess(&none, None, sigma, 1.0).is_none());
}
