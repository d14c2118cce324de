//! Error maps against their formulas.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;

const WIDTH: usize = 7;
const HEIGHT: usize = 5;

fn planes(max: f32, rng: &mut Pcg32) -> Planes {
    let mut planes = Planes::new(WIDTH, HEIGHT, 3);
    planes.data_mut().iter_mut().for_each(|v| *v = max * rng.random::<f32>());
    planes
}

#[test]
fn maps_of_cross_filtered_images_agree_with_the_formulas() {
    let mut rng = Pcg32::seed_from_u64(3);
    let mut pair = |max: f32| [(); 2].map(|()| planes(max, &mut rng));
    let (mean, variance, filtered, emission) = (pair(1.0), pair(0.3), pair(1.0), pair(0.5));
    let noisy = DualBuffer { mean, variance };
    let own: [Vec<f32>; 2] = [(); 2].map(|()| (0..35).map(|_| 0.7 * rng.random::<f32>()).collect());
    for emission in [Some(&emission), None] {
        let found = ErrorEstimate::cross_filtered(&noisy, &filtered, emission, [&own[0], &own[1]]);
        let (mut bias, mut mean_variance) = (vec![0.0; 35], vec![0.0; 35]);
        for i in 0..35 {
            let mut residual = 0.0;
            let a = own.each_ref().map(|own| f64::from(own[i]));
            for k in 0..3 {
                let at = |halves: &[Planes; 2]| halves.each_ref().map(|half| f64::from(half.plane(k)[i]));
                let ([f, g], [c, d], [v, w]) = (at(&filtered), at(&noisy.mean), at(&noisy.variance));
                let emitted = emission.map_or(0.0, |emission| at(emission)[0] - at(emission)[1]);
                let variance = ((f - g + emitted) / 2.0).powi(2);
                assert!((f64::from(found.variance.plane(k)[i]) - variance).abs() < 1e-6);
                mean_variance[i] += (variance / 3.0) as f32;

                // Risk of the mean of the halves without the variance
                let quarter = ((f - g) / 2.0).powi(2);
                let risks = [(f - c).powi(2) - v + 2.0 * v * a[0], (g - d).powi(2) - w + 2.0 * w * a[1]];
                bias[i] += (((risks[0] + risks[1]) / 2.0 - quarter - quarter) / 3.0) as f32;

                let change = ((f + g - c - d) / 2.0).powi(2);
                let expected = (v + w) / 4.0 * (1.0 - a[0] - a[1]).max(0.0) + quarter;
                residual += change / expected / 3.0;
            }
            let relative = f64::from(found.residual.plane(0)[i]) / residual;
            assert!((relative - 1.0).abs() < 1e-3, "{i}: {relative}");
        }
        let [bias, mean_variance] =
            [bias, mean_variance].map(|plane| blur::gaussian(WIDTH, HEIGHT, &plane, BIAS_SIGMA));
        assert!(bias.iter().any(|&b| b > 0.0));
        for (i, &found) in found.error.plane(0).iter().enumerate() {
            assert!((found - mean_variance[i] - bias[i].max(0.0)).abs() < 1e-5, "{i}: {found}");
        }
    }
}

#[test]
fn residuals_without_noise_are_zero() {
    let zero = || [(); 2].map(|()| Planes::new(WIDTH, HEIGHT, 3));
    let noisy = DualBuffer { mean: zero(), variance: zero() };
    let mut filtered = zero();
    filtered.iter_mut().for_each(|half| half.plane_mut(1)[6] = 1e3);
    filtered[0].plane_mut(2)[7] = 2e-3;
    let own = [1.0; 35];
    let residual = ErrorEstimate::cross_filtered(&noisy, &filtered, None, [&own, &own]).residual;
    assert_eq!(residual.plane(0)[..6], [0.0; 6]);
    // No noise and no difference of the halves: nothing is expected, and the residual is 0.
    assert_eq!(residual.plane(0)[6], 0.0);
    // A change of (10⁻³)² where (10⁻³)² is expected, in one of three channels
    assert!((residual.plane(0)[7] - 1.0 / 3.0).abs() < 1e-6);
}
