//! Error maps against their formulas, and risks against true errors.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;

const WIDTH: usize = 7;
const HEIGHT: usize = 5;
const PIXELS: usize = WIDTH * HEIGHT;

fn planes(max: f32, rng: &mut Pcg32) -> Planes {
    let mut planes = Planes::new(WIDTH, HEIGHT, 3);
    planes.data_mut().iter_mut().for_each(|v| *v = max * rng.random::<f32>());
    planes
}

fn counts(n: impl Fn(usize) -> [u32; 2]) -> HalfCounts {
    HalfCounts::new(WIDTH, [0, 1].map(|h| (0..PIXELS).map(|i| n(i)[h]).collect()))
}

/// Noisy values of a part and their filtered ones, all random.
fn random_part(max: f32, rng: &mut Pcg32) -> (DualBuffer, [LinearEstimate; 2]) {
    let mut pair = |max: f32| [(); 2].map(|()| planes(max, rng));
    let (mean, variance, filtered) = (pair(max), pair(0.3 * max), pair(max));
    let filtered = filtered.map(|value| LinearEstimate {
        value,
        derivative: (0..PIXELS).map(|_| 0.7 * rng.random::<f32>()).collect(),
    });
    (DualBuffer { mean, variance }, filtered)
}

#[test]
fn maps_of_cross_filtered_images_agree_with_the_formulas() {
    let mut rng = Pcg32::seed_from_u64(3);
    let (colour, emission) = (random_part(1.0, &mut rng), random_part(0.5, &mut rng));
    let part =
        |(noisy, filtered): &'static (DualBuffer, [LinearEstimate; 2])| FilteredPart { noisy, filtered };
    let [colour, emission] = [colour, emission].map(|made| &*Box::leak(Box::new(made)));
    let n = |i: usize| if i == 9 { [3, 0] } else { [1 + i as u32 % 3, 2] };
    for emitted in [Some(emission), None] {
        let found = ErrorMaps::cross_filtered(part(colour), emitted.map(part), &counts(n));
        for i in 0..PIXELS {
            let mut residual = 0.0;
            let own = |part: &(DualBuffer, [LinearEstimate; 2])| {
                part.1.each_ref().map(|h| f64::from(h.derivative[i]))
            };
            let a = own(colour);
            for k in 0..3 {
                let at = |planes: &Planes| f64::from(planes.plane(k)[i]);
                let values = |part: &(DualBuffer, [LinearEstimate; 2])| {
                    [part.0.mean.each_ref().map(at), part.1.each_ref().map(|half| at(&half.value))]
                };
                let [c, f] = values(colour);
                let [v, w] = colour.0.variance.each_ref().map(at);
                let ([e, g], b) = emitted.map_or(([[0.0; 2]; 2], [0.0; 2]), |part| (values(part), own(part)));
                let half = f[0] + g[0] - f[1] - g[1];
                assert!((f64::from(found.variance.plane(k)[i]) - half.powi(2) / 4.0).abs() < 1e-6);

                let change = ((f[0] + f[1] - c[0] - c[1]) / 2.0).powi(2);
                let expected = (v + w) / 4.0 * (1.0 - a[0] - a[1]).max(0.0) + ((f[0] - f[1]) / 2.0).powi(2);
                residual += change / expected / 3.0;

                // Variance of c_h, and its covariance with F_h
                let [n_a, n_b] = n(i).map(f64::from);
                let p = [n_a / (n_a + n_b), n_b / (n_a + n_b)];
                let (d, d_emission) = (c[0] - c[1], e[0] - e[1]);
                let risk = |h: usize| {
                    let noise = p[1 - h] * (d + d_emission).powi(2);
                    let covariance = p[1 - h] * (a[h] * d + b[h] * d_emission) * (d + d_emission);
                    p[h] * ((f[h] + g[h] - c[h] - e[h]).powi(2) - noise + 2.0 * covariance)
                };
                let expected = if n_b > 0.0 { risk(0) + risk(1) - p[0] * p[1] * half.powi(2) } else { 0.0 };
                assert!((f64::from(found.risk.plane(k)[i]) - expected).abs() < 1e-5, "{i} {k}");
            }
            let relative = f64::from(found.residual.plane(0)[i]) / residual;
            assert!((relative - 1.0).abs() < 1e-3, "{i}: {relative}");
        }
        let blurred = |planes: &Planes| {
            let mean = |i: usize| (0..3).map(|k| planes.plane(k)[i]).sum::<f32>() / 3.0;
            blur::gaussian(WIDTH, HEIGHT, &(0..PIXELS).map(mean).collect::<Vec<_>>(), ERROR_SIGMA)
        };
        let [variance, risk] = [&found.variance, &found.risk].map(blurred);
        assert!(variance.iter().zip(&risk).any(|(v, r)| r > v));
        for (i, &found) in found.error.plane(0).iter().enumerate() {
            assert!((found - variance[i].max(risk[i])).abs() < 1e-6, "{i}: {found}");
        }
    }
}

/// A half as a filter with fixed weights makes it of noise around a ramp: the mean of a pixel and its neighbours to the
/// left and right, the pixel with weight ½.
fn smoothed(values: &Planes) -> LinearEstimate {
    let mut filtered = LinearEstimate::unfiltered(WIDTH, HEIGHT, [0, 1, 2].map(|c| values.plane(c)));
    filtered.derivative.fill(0.5);
    for (out, from) in filtered.value.planes_mut().zip(values.data().chunks(PIXELS)) {
        for i in 0..PIXELS {
            let row = i / WIDTH * WIDTH;
            let [left, right] = [(i + WIDTH - 1 - row) % WIDTH, (i + 1 - row) % WIDTH];
            out[i] = 0.5 * from[i] + 0.25 * (from[row + left] + from[row + right]);
        }
    }
    filtered
}

#[test]
fn the_mean_risk_is_the_mean_squared_error() {
    let truth = |i: usize| (i % WIDTH) as f32 / 4.0;
    let n = [3u32, 1];
    let mut rng = Pcg32::seed_from_u64(9);
    let renders = 600;
    // Differences of both risks from the true error, one mean per render
    let mut differences = [(); 2].map(|()| Vec::new());
    for _ in 0..renders {
        let mean = n.map(|n| {
            let mut half = Planes::new(WIDTH, HEIGHT, 3);
            for (i, v) in half.data_mut().iter_mut().enumerate() {
                let noise = |_| 2.0 * rng.random::<f32>() - 1.0;
                *v = truth(i % PIXELS) + (0..n).map(noise).sum::<f32>() / n as f32;
            }
            half
        });
        let filtered = mean.each_ref().map(smoothed);
        let [f_a, f_b] = filtered.each_ref().map(|half| &half.value);
        let counts = counts(|_| n);
        let image = counts.mean([f_a, f_b]);
        let noisy = DualBuffer { variance: mean.clone(), mean: mean.clone() };
        let cross =
            ErrorMaps::cross_filtered(FilteredPart { noisy: &noisy, filtered: &filtered }, None, &counts);
        let [a, b] = &mean;
        let own = ErrorMaps::self_filtered(&image, [f_a, f_b], a, a, [a, b], counts.integers());
        let squared = |(i, &v): (usize, &f32)| f64::from(v - truth(i % PIXELS)).powi(2);
        let error = image.data().iter().enumerate().map(squared).sum::<f64>();
        for (differences, risk) in differences.iter_mut().zip([cross.risk, own.risk]) {
            let sum: f64 = risk.data().iter().map(|&v| f64::from(v)).sum();
            differences.push((sum - error) / (3 * PIXELS) as f64);
        }
    }
    for differences in differences {
        let mean = differences.iter().sum::<f64>() / renders as f64;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / renders as f64;
        assert!(mean.abs() < 4.0 * (variance / renders as f64).sqrt(), "{mean} {variance}");
        // The error is about 0.13: 4 standard errors are a small part of it.
        assert!((variance / renders as f64).sqrt() < 2e-3);
    }
}

#[test]
fn residuals_without_noise_are_zero() {
    let zero = || [(); 2].map(|()| Planes::new(WIDTH, HEIGHT, 3));
    let noisy = DualBuffer { mean: zero(), variance: zero() };
    let mut filtered = zero();
    filtered.iter_mut().for_each(|half| half.plane_mut(1)[6] = 1e3);
    filtered[0].plane_mut(2)[7] = 2e-3;
    let filtered = filtered.map(|value| LinearEstimate { value, derivative: vec![1.0; PIXELS] });
    let part = FilteredPart { noisy: &noisy, filtered: &filtered };
    let residual = ErrorMaps::cross_filtered(part, None, &counts(|_| [2, 2])).residual;
    assert_eq!(residual.plane(0)[..6], [0.0; 6]);
    // No noise and no difference of the halves: nothing is expected, and the residual is 0.
    assert_eq!(residual.plane(0)[6], 0.0);
    // A change of (10⁻³)² where (10⁻³)² is expected, in one of three channels
    assert!((residual.plane(0)[7] - 1.0 / 3.0).abs() < 1e-6);
}
