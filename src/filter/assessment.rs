//! What the two halves tell of a filtered image: its variance, its bias, its error.
//!
//! The weights of a half come from the other half, so the filtered half F_h is linear in its own
//! noisy values c_h and, with a_h = ∂F_h/∂c_h, R = ½Σ_h[(F_h − c_h)² − v_h + 2v_h a_h] − ¼(F_A − F_B)²
//! estimates the squared error of ½(F_A + F_B) without bias (Stein's estimate for a linear filter;
//! Bitterli et al. 2016, section 5, use the halves alike). Pixel by pixel it is far too noisy to
//! use; blurred it is a map.

use rayon::prelude::*;

use crate::image::Planes;

use super::LARGEST_RESIDUAL;
use super::blur;
use super::halves::Halves;

/// Blur of the risk, in pixels.
const RISK_SIGMA: f32 = 4.0;

/// Maps of a filtered image.
pub(super) struct Assessment {
    /// ¼(F_A − F_B)², emission included: 3 planes.
    pub variance: Planes,
    /// (F − c)² over its expectation where the filter is unbiased: 1 plane.
    pub residual: Planes,
    /// Estimated squared error, mean of channels: 1 plane.
    pub error: Planes,
}

impl Assessment {
    /// `noisy` went into the filter, `filtered` came out, `emission` is added to it: 3 planes of each
    /// half. `own_weight`: a_h of each pixel.
    pub fn of(
        noisy: &Halves,
        filtered: &[Planes; 2],
        emission: Option<&[Planes; 2]>,
        own_weight: [&[f32]; 2],
    ) -> Self {
        let (width, height) = (filtered[0].width(), filtered[0].height());
        let own = |i: usize| 0.5 * (own_weight[0][i] + own_weight[1][i]);
        let mut variance = Planes::new(width, height, 3);
        let mut residual = Planes::new(width, height, 1);
        let mut bias = vec![0.0; width * height];
        let mut spread = vec![0.0; width * height];
        for (channel, variance) in variance.planes_mut().enumerate() {
            let [c_a, c_b] = [0, 1].map(|h| noisy.mean[h].plane(channel));
            let [f_a, f_b] = [0, 1].map(|h| filtered[h].plane(channel));
            let [v_a, v_b] = [0, 1].map(|h| noisy.variance[h].plane(channel));
            let maps = variance.par_iter_mut().zip(residual.data_mut()).zip(&mut bias).zip(&mut spread);
            maps.enumerate().with_min_len(width).for_each(|(i, (((variance, residual), bias), spread))| {
                let between = 0.25 * (f_a[i] - f_b[i]).powi(2);
                let of_half = |f: f32, c: f32, v: f32, a: f32| (f - c).powi(2) - v + 2.0 * v * a;
                let of_a = of_half(f_a[i], c_a[i], v_a[i], own_weight[0][i]);
                let of_b = of_half(f_b[i], c_b[i], v_b[i], own_weight[1][i]);
                *bias += (0.5 * (of_a + of_b) - 2.0 * between) / 3.0;
                let emitted = emission.map_or(0.0, |[a, b]| a.plane(channel)[i] - b.plane(channel)[i]);
                *variance = 0.25 * (f_a[i] - f_b[i] + emitted).powi(2);
                *spread += *variance / 3.0;

                let expected = 0.25 * (v_a[i] + v_b[i]) * (1.0 - 2.0 * own(i)).max(0.0) + between;
                let seen = (0.5 * (f_a[i] + f_b[i] - c_a[i] - c_b[i])).powi(2);
                // 0/0 is a pixel without noise that was left alone.
                let times = if expected > 0.0 { seen / expected } else { 0.0 };
                *residual += times.min(LARGEST_RESIDUAL) / 3.0;
            });
        }
        let [bias, spread] = [bias, spread].map(|plane| blur::gaussian(width, height, &plane, RISK_SIGMA));
        let mut error = Planes::new(width, height, 1);
        for (error, (bias, spread)) in error.plane_mut(0).iter_mut().zip(bias.iter().zip(&spread)) {
            *error = spread + bias.max(0.0);
        }
        Self { variance, residual, error }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;

    const WIDTH: usize = 7;
    const HEIGHT: usize = 5;

    fn planes(most: f32, rng: &mut Pcg32) -> Planes {
        let mut planes = Planes::new(WIDTH, HEIGHT, 3);
        planes.data_mut().iter_mut().for_each(|v| *v = most * rng.random::<f32>());
        planes
    }

    #[test]
    fn maps_are_those_of_the_formulas() {
        let mut rng = Pcg32::seed_from_u64(3);
        let mut pair = |most: f32| [(); 2].map(|()| planes(most, &mut rng));
        let (mean, variance, filtered, emission) = (pair(1.0), pair(0.3), pair(1.0), pair(0.5));
        let noisy = Halves { mean, variance };
        let own: [Vec<f32>; 2] = [(); 2].map(|()| (0..35).map(|_| 0.7 * rng.random::<f32>()).collect());
        for emission in [Some(&emission), None] {
            let found = Assessment::of(&noisy, &filtered, emission, [&own[0], &own[1]]);
            let (mut bias, mut spread) = (vec![0.0; 35], vec![0.0; 35]);
            for i in 0..35 {
                let mut residual = 0.0;
                let a = own.each_ref().map(|own| f64::from(own[i]));
                for k in 0..3 {
                    let of = |halves: &[Planes; 2]| halves.each_ref().map(|half| f64::from(half.plane(k)[i]));
                    let ([f, g], [c, d], [v, w]) = (of(&filtered), of(&noisy.mean), of(&noisy.variance));
                    let emitted = emission.map_or(0.0, |emission| of(emission)[0] - of(emission)[1]);
                    let variance = ((f - g + emitted) / 2.0).powi(2);
                    assert!((f64::from(found.variance.plane(k)[i]) - variance).abs() < 1e-6);
                    spread[i] += (variance / 3.0) as f32;

                    // Risk of the mean of the halves, less what the variance holds already.
                    let quarter = ((f - g) / 2.0).powi(2);
                    let risks = [(f - c).powi(2) - v + 2.0 * v * a[0], (g - d).powi(2) - w + 2.0 * w * a[1]];
                    bias[i] += (((risks[0] + risks[1]) / 2.0 - quarter - quarter) / 3.0) as f32;

                    let seen = ((f + g - c - d) / 2.0).powi(2);
                    let expected = (v + w) / 4.0 * (1.0 - a[0] - a[1]).max(0.0) + quarter;
                    residual += seen / expected / 3.0;
                }
                let relative = f64::from(found.residual.plane(0)[i]) / residual;
                assert!((relative - 1.0).abs() < 1e-3, "{i}: {relative}");
            }
            let [bias, spread] =
                [bias, spread].map(|plane| blur::gaussian(WIDTH, HEIGHT, &plane, RISK_SIGMA));
            assert!(bias.iter().any(|&b| b > 0.0));
            for (i, &found) in found.error.plane(0).iter().enumerate() {
                assert!((found - spread[i] - bias[i].max(0.0)).abs() < 1e-5, "{i}: {found}");
            }
        }
    }

    #[test]
    fn nothing_expected_and_nothing_seen_is_no_residual_and_anything_else_is_bounded() {
        let zero = || [(); 2].map(|()| Planes::new(WIDTH, HEIGHT, 3));
        let noisy = Halves { mean: zero(), variance: zero() };
        let mut filtered = zero();
        filtered.iter_mut().for_each(|half| half.plane_mut(1)[6] = 1e3);
        filtered[0].plane_mut(2)[7] = 2e-3;
        let own = [1.0; 35];
        let residual = Assessment::of(&noisy, &filtered, None, [&own, &own]).residual;
        assert_eq!(residual.plane(0)[..6], [0.0; 6]);
        // No noise and no difference of the halves: 0 is expected, whatever is seen.
        assert_eq!(residual.plane(0)[6], 0.0);
        // (10⁻³)² seen and (10⁻³)² expected in one channel of three.
        assert!((residual.plane(0)[7] - 1.0 / 3.0).abs() < 1e-6);
    }
}
