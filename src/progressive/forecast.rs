//! The error over time, and what the next halving of it will cost.
//!
//! Error falls as a power of the time spent on samples: t⁻¹ for independent samples, more slowly where a
//! filter has already taken the easy part. The power is fitted to the latest estimates (least squares
//! in logarithms, relative to the latest, newer points counting more), and kept within what renders show.

use serde::Serialize;

/// What the image's relMSE was estimated to be at some time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Time spent on samples and on filtering them, in seconds.
    pub seconds: f64,
    pub error: f64,
}

/// Estimates that the fit looks back on.
const LOOK_BACK: usize = 6;
/// Factor on the weight of a point from one to the next older.
const FADING: f64 = 0.7;
/// Smallest and largest power that a fit may give.
const POWERS: (f64, f64) = (0.25, 2.0);
/// Power while there is one point only: independent samples.
const PLAIN_POWER: f64 = 1.0;

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

/// Fits a forecast to points in order of time; `None` before the first estimate that is above zero.
pub fn forecast(points: &[Point]) -> Option<Forecast> {
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
    let spread = xx - x * x / w;
    let slope = if spread > 1e-9 { -(xy - x * y / w) / spread } else { PLAIN_POWER };
    let power = slope.clamp(POWERS.0, POWERS.1);
    let found = Forecast { power, halving_seconds: 0.0 };
    Some(Forecast { halving_seconds: found.halving_after(latest.seconds), ..found })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(power: f64, times: &[f64]) -> Vec<Point> {
        times.iter().map(|&seconds| Point { seconds, error: 0.3 * seconds.powf(-power) }).collect()
    }

    #[test]
    fn a_power_law_is_found_and_its_halving_told() {
        for power in [0.5, 1.0, 1.4] {
            let found = forecast(&points(power, &[1.0, 2.0, 4.0, 8.0])).unwrap();
            assert!((found.power - power).abs() < 1e-9);
            let halved = 8.0 * 2f64.powf(1.0 / power);
            assert!((8.0 + found.halving_seconds - halved).abs() < 1e-9);
            assert!((8.0 * found.growth_to(0.4, 0.2) - halved).abs() < 1e-9);
            assert_eq!(found.growth_to(0.1, 0.2), 1.0);
        }
    }

    #[test]
    fn one_estimate_is_taken_for_independent_samples() {
        let found = forecast(&points(1.0, &[3.0])).unwrap();
        assert_eq!((found.power, found.halving_seconds), (1.0, 3.0));
    }

    #[test]
    fn noise_cannot_make_it_absurd() {
        let rising = [
            Point { seconds: 1.0, error: 0.1 },
            Point { seconds: 2.0, error: 0.2 },
            Point { seconds: 3.0, error: -1.0 },
        ];
        assert_eq!(forecast(&rising).unwrap().power, POWERS.0);
        assert_eq!(forecast(&[Point { seconds: 1.0, error: -1.0 }]), None);
    }
}
