//! The error over time, and what the next halving of it will cost.
//!
//! Error falls as a power of the time spent on samples: t⁻¹ for independent samples, and more slowly the more of their noise
//! the filter has already removed. With the gain g, the error of the unfiltered image over that of the filtered one, the power is
//! expected to be 1 − c ln g: the easy part of the noise is removed at first, and a filter that removes nothing more leaves t⁻¹.
//! That is corrected by the latest estimates (least squares in logarithms, relative to the latest, newer points counting more;
//! ridge regression), and kept within what renders show.

use serde::Serialize;

/// What the image's relMSE was estimated to be at some time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Seconds, or what is proportional to them.
    pub seconds: f64,
    pub error: f64,
    /// That of the unfiltered image of the same samples.
    pub unfiltered_error: f64,
}

/// Estimates that the fit looks back on.
const LOOK_BACK: usize = 6;
/// Factor on the weight of a point from one to the next older.
const FADING: f64 = 0.7;
/// Smallest and largest power that a fit may give.
const POWERS: (f64, f64) = (0.25, 2.0);
/// c, by which the power falls with the logarithm of the gain. Chosen on our five scenes and 15 random ones.
const POWER_PER_GAIN: f64 = 0.09;
/// Weight of the expected power, as a sum of squared logarithms of times. Chosen likewise.
const EXPECTED_WEIGHT: f64 = 4.0;

impl Point {
    /// Returns the power of time by which the error is expected to fall from here.
    fn expected_power(&self) -> f64 {
        let gain = (self.unfiltered_error / self.error).max(1.0);
        1.0 - POWER_PER_GAIN * gain.ln()
    }
}

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

/// Fits a forecast to points in order of time, of images by one denoiser. `latest` is the image whose error is to fall, perhaps by another.
/// `None` before the first estimate that is above zero.
pub fn forecast(points: &[Point], latest: &Point) -> Option<Forecast> {
    let usable = |p: &&Point| p.error > 0.0 && p.seconds > 0.0;
    let recent: Vec<_> = points.iter().filter(usable).rev().take(LOOK_BACK).collect();
    let newest = recent.first()?;
    let weighted = recent.iter().scan(1.0, |weight, p| {
        let now = *weight;
        *weight *= FADING;
        Some((now, (p.seconds / newest.seconds).ln(), (p.error / newest.error).ln()))
    });
    let (mut w, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (weight, t, e) in weighted {
        w += weight;
        x += weight * t;
        y += weight * e;
        xx += weight * t * t;
        xy += weight * t * e;
    }
    let (spread, fall) = (xx - x * x / w, x * y / w - xy);
    let power = (fall + EXPECTED_WEIGHT * latest.expected_power()) / (spread + EXPECTED_WEIGHT);
    let power = power.clamp(POWERS.0, POWERS.1);
    let found = Forecast { power, halving_seconds: 0.0 };
    Some(Forecast { halving_seconds: found.halving_after(latest.seconds), ..found })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::LN_2;

    use super::*;

    /// Points of an error that falls as a power of time, and that a filter leaves of one `gain` times as large.
    fn points(power: f64, gain: f64, times: &[f64]) -> Vec<Point> {
        let error = |seconds: f64| 0.3 * seconds.powf(-power);
        let point =
            |&seconds| Point { seconds, error: error(seconds), unfiltered_error: gain * error(seconds) };
        times.iter().map(point).collect()
    }

    fn forecast_of(points: &[Point]) -> Option<Forecast> {
        forecast(points, points.last()?)
    }

    #[test]
    fn a_power_law_is_found_between_it_and_the_expected_power_and_its_halving_told() {
        let expected_power = 1.0 - POWER_PER_GAIN * 20f64.ln();
        for power in [0.5, 1.0, 1.4] {
            let found = forecast_of(&points(power, 20.0, &[1.0, 2.0, 4.0, 8.0])).unwrap();
            // Of weights 1, 0.7, 0.49 and 0.343 at 0 to 3 halvings: Σwk² − (Σwk)² ∕ Σw
            let spread = (5.747 - 2.709f64.powi(2) / 2.533) * LN_2 * LN_2;
            let expected = (spread * power + EXPECTED_WEIGHT * expected_power) / (spread + EXPECTED_WEIGHT);
            assert!((found.power - expected).abs() < 1e-9, "{} {expected}", found.power);
            let of_long = forecast_of(&points(power, 20.0, &[1e-18, 1e-12, 1e-6, 8.0])).unwrap().power;
            assert!((of_long - power).abs() < 0.02, "{of_long}");
            let halved = 8.0 * 2f64.powf(1.0 / found.power);
            assert!((8.0 + found.halving_seconds - halved).abs() < 1e-9);
            assert!((8.0 * found.growth_to(0.4, 0.2) - halved).abs() < 1e-9);
            assert_eq!(found.growth_to(0.1, 0.2), 1.0);
        }
    }

    #[test]
    fn the_more_a_filter_removes_the_more_slowly_its_error_falls() {
        let power = |gain| forecast_of(&points(1.0, gain, &[3.0])).unwrap().power;
        let found = forecast_of(&points(1.0, 1.0, &[3.0])).unwrap();
        assert_eq!((found.power, found.halving_seconds), (1.0, 3.0), "nothing is removed");
        assert_eq!(power(0.9), 1.0, "noise of the estimates");
        assert!((power(10.0) - (1.0 - POWER_PER_GAIN * 10f64.ln())).abs() < 1e-12);
        assert_eq!(power(f64::MAX), POWERS.0);
    }

    #[test]
    fn the_gain_is_that_of_the_image_whose_error_is_to_fall() {
        let drafts = points(0.8, 4.0, &[1.0, 2.0]);
        let by_another = Point { error: 0.01, unfiltered_error: 1.0, ..drafts[1] };
        let [found, of_draft] =
            [&by_another, &drafts[1]].map(|latest| forecast(&drafts, latest).unwrap().power);
        assert!(found < of_draft - 0.1, "{found} {of_draft}");
    }

    #[test]
    fn the_power_is_limited() {
        let point = |seconds, error| Point { seconds, error, unfiltered_error: error };
        let rising = [point(1.0, 0.1), point(1e4, 9.0), point(3e4, -1.0)];
        assert_eq!(forecast_of(&rising).unwrap().power, POWERS.0);
        assert_eq!(forecast_of(&[point(1.0, -1.0)]), None);
    }
}
