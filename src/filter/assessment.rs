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
