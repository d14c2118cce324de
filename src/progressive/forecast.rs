//! The error over time, and what the next halving of it will cost.
//!
//! Error falls as a power of the time spent on samples: t⁻¹ for independent samples, more slowly where a
//! filter has already taken the easy part. The power is fitted to the latest estimates (least squares
//! in logarithms, relative to the latest, newer points counting more), regularised towards the typical one (ridge regression),
//! and kept within what renders show.

use serde::Serialize;

use crate::filter::{DenoiserName, UNFILTERED};

/// What the image's relMSE was estimated to be at some time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Seconds, or what is proportional to them.
    pub seconds: f64,
    pub error: f64,
}

/// Estimates that the fit looks back on.
const LOOK_BACK: usize = 6;
/// Factor on the weight of a point from one to the next older.
const FADING: f64 = 0.7;
/// Smallest and largest power that a fit may give.
const POWERS: (f64, f64) = (0.25, 2.0);
/// Power of independent samples.
const UNFILTERED_POWER: f64 = 1.0;
/// Typical power of filtered images: on our five scenes it is 0.62 to 0.93, from 8 to 128 samples per pixel.
pub(super) const FILTERED_POWER: f64 = 0.7;
/// Weight of the typical power, as a sum of squared logarithms of times. Chosen on our five scenes: 25 of 30 forecasts after 8 to 32
/// samples per pixel were right within 30 %, and 5 by the fit alone.
const TYPICAL_WEIGHT: f64 = 1.5;

/// How the error is expected to go on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Error ∝ time⁻ᵖ.
    pub power: f64,
    /// Seconds from the latest estimate until its error is halved.
    pub halving_seconds: f64,
}

impl Forecast {
    /// Returns the further seconds that halve the error after `seconds`.
    pub fn halving_after(&self, seconds: f64) -> f64 {
        seconds * (2f64.powf(1.0 / self.power) - 1.0)
    }

    /// Returns the factor on the time, or on the samples, by which the error falls from `error` to `target`; at least 1.
    pub fn growth_to(&self, error: f64, target: f64) -> f64 {
        (error / target).max(1.0).powf(1.0 / self.power)
    }
}

/// Fits a forecast to points in order of time, of images by a denoiser; `None` before the first estimate that is above zero.
pub fn forecast(points: &[Point], made_by: DenoiserName) -> Option<Forecast> {
    let usable = |p: &&Point| p.error > 0.0 && p.seconds > 0.0;
    let recent: Vec<_> = points.iter().filter(usable).rev().take(LOOK_BACK).collect();
    let latest = recent.first()?;
    let weighted = recent.iter().scan(1.0, |weight, p| {
        let now = *weight;
        *weight *= FADING;
        Some((now, (p.seconds / latest.seconds).ln(), (p.error / latest.error).ln()))
    });
    let (mut w, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (weight, t, e) in weighted {
        w += weight;
        x += weight * t;
        y += weight * e;
        xx += weight * t * t;
        xy += weight * t * e;
    }
    let typical = if made_by == UNFILTERED.name() { UNFILTERED_POWER } else { FILTERED_POWER };
    let (spread, fall) = (xx - x * x / w, x * y / w - xy);
    let power = ((fall + TYPICAL_WEIGHT * typical) / (spread + TYPICAL_WEIGHT)).clamp(POWERS.0, POWERS.1);
    let found = Forecast { power, halving_seconds: 0.0 };
    Some(Forecast { halving_seconds: found.halving_after(latest.seconds), ..found })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::LN_2;

    use super::*;

    fn points(power: f64, times: &[f64]) -> Vec<Point> {
        times.iter().map(|&seconds| Point { seconds, error: 0.3 * seconds.powf(-power) }).collect()
    }

    const LEARNED: DenoiserName = DenoiserName { method: "learned", preset: None };

    #[test]
    fn a_power_law_is_found_between_it_and_the_typical_power_and_its_halving_told() {
        for power in [0.5, 1.0, 1.4] {
            let found = forecast(&points(power, &[1.0, 2.0, 4.0, 8.0]), LEARNED).unwrap();
            // Of weights 1, 0.7, 0.49 and 0.343 at 0 to 3 halvings: Σwk² − (Σwk)² ∕ Σw
            let spread = (5.747 - 2.709f64.powi(2) / 2.533) * LN_2 * LN_2;
            let expected = (spread * power + TYPICAL_WEIGHT * FILTERED_POWER) / (spread + TYPICAL_WEIGHT);
            assert!((found.power - expected).abs() < 1e-9, "{} {expected}", found.power);
            let of_long = forecast(&points(power, &[1e-9, 1e-6, 1e-3, 8.0]), LEARNED).unwrap().power;
            assert!((of_long - power).abs() < 0.02, "{of_long}");
            let halved = 8.0 * 2f64.powf(1.0 / found.power);
            assert!((8.0 + found.halving_seconds - halved).abs() < 1e-9);
            assert!((8.0 * found.growth_to(0.4, 0.2) - halved).abs() < 1e-9);
            assert_eq!(found.growth_to(0.1, 0.2), 1.0);
        }
    }

    #[test]
    fn one_estimate_is_followed_by_the_typical_power() {
        let found = forecast(&points(1.0, &[3.0]), UNFILTERED.name()).unwrap();
        assert_eq!((found.power, found.halving_seconds), (UNFILTERED_POWER, 3.0));
        let filtered = forecast(&points(1.0, &[3.0]), LEARNED).unwrap();
        assert!((filtered.power - FILTERED_POWER).abs() < 1e-9, "{}", filtered.power);
    }

    #[test]
    fn the_power_is_limited() {
        let rising = [
            Point { seconds: 1.0, error: 0.1 },
            Point { seconds: 20.0, error: 9.0 },
            Point { seconds: 30.0, error: -1.0 },
        ];
        assert_eq!(forecast(&rising, LEARNED).unwrap().power, POWERS.0);
        assert_eq!(forecast(&[Point { seconds: 1.0, error: -1.0 }], LEARNED), None);
    }
}
