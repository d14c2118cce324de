//! Measures error against samples and seconds for each [`Configuration`](crate::configuration::Configuration).
//!
//! Takes a scene, sample counts and seeds; gives a point for each render, from the ledger where it is recorded.

use std::collections::BTreeSet;

use prpf::adaptive::Sampling;
use prpf::filter::{DEFAULT, UNFILTERED};
use prpf::geometry::Accel;
use prpf::progressive::StoppedBy;

use crate::configuration::CONFIGURATIONS;
use crate::estimate_check::EstimateCheck;
use crate::ledger::{Key, Values, values};
use crate::report::median;
use crate::session::Session;
use crate::statistics::{interpolate_log_log, slope_log_log, variance_within};
use crate::test_scene::TestScene;
use crate::trial::Trial;

/// Cost and error of an image.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub spp: u32,
    pub seed: u64,
    pub seconds: f64,
    /// relMSE.
    pub error: f64,
    /// relMSE without the worst 0.1 % of the pixels.
    pub trimmed: f64,
    pub flip: f64,
    /// Seconds until the error is halved, as the program forecasts; `None` without an estimate.
    pub halving_seconds: Option<f64>,
}

impl Point {
    /// Reads the point of the image of a trial.
    pub fn new(trial: &Trial, values: &Values) -> Self {
        Self::named(trial, values, "", "seconds")
    }

    /// Reads the point of the mean of a trial's samples; its time leaves the filter out.
    fn unfiltered(trial: &Trial, values: &Values) -> Self {
        Self::named(trial, values, "unfiltered ", "seconds of samples")
    }

    fn named(trial: &Trial, values: &Values, image: &str, seconds: &str) -> Self {
        let error = |name: &str| values[&format!("{image}{name}")];
        Self {
            spp: trial.spp,
            seed: trial.seed,
            seconds: values[seconds],
            error: error("relmse"),
            trimmed: error("trimmed relmse"),
            flip: error("flip"),
            halving_seconds: values.get("halving seconds").copied(),
        }
    }
}

/// Accesses an error of a point.
pub type Metric = fn(&Point) -> f64;

/// The measurements on one scene.
#[derive(Default)]
pub struct Curves {
    /// By index of [`CONFIGURATIONS`].
    pub points: [Vec<Point>; 4],
    /// Likewise; none of the first, which is no render of its own.
    pub checks: [Vec<EstimateCheck>; 4],
    /// Variance of the logarithm of one measured time.
    pub clock_variance: f64,
}

/// Which images to measure.
pub struct Counts<'a> {
    /// Samples per pixel, ascending.
    pub spp: &'a [u32],
    /// Samples per pixel of more uniform images, whose curve then reaches the time of the last adaptive one.
    pub more_uniform_spp: &'a [u32],
    pub seeds: u64,
}

/// Measures all configurations at ascending sample counts, and checks the program's error estimates. The unfiltered
/// uniform image is the mean of the filtered render's samples; its time leaves the filter out.
pub fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    counts: &Counts,
) -> anyhow::Result<Curves> {
    let mut curves = Curves::default();
    let with_seed = |seed| {
        let spp = counts.spp.iter().map(move |&spp| (seed, spp, false));
        spp.chain(counts.more_uniform_spp.iter().map(move |&spp| (seed, spp, true)))
    };
    for (seed, spp, only_uniform) in (0..counts.seeds).flat_map(with_seed) {
        for (i, configuration) in CONFIGURATIONS.iter().enumerate().skip(1) {
            if only_uniform && configuration.sampling != Sampling::Uniform {
                continue;
            }
            let denoiser = if configuration.filtered { DEFAULT } else { UNFILTERED };
            let trial = Trial::new(configuration.sampling, denoiser, spp, seed);
            let measured = measure_trial(session, test_scene, accel, &trial, configuration.name())?;
            curves.points[i].push(Point::new(&trial, &measured));
            if configuration.sampling == Sampling::Uniform {
                curves.points[0].push(Point::unfiltered(&trial, &measured));
            }
            curves.checks[i].extend(EstimateCheck::from_values(spp, &measured));
        }
    }
    let groups = curves.points.iter().flat_map(|points| seconds_by_count(points));
    let logarithms: Vec<Vec<f64>> =
        groups.map(|seconds| seconds.into_iter().map(f64::ln).collect()).collect();
    curves.clock_variance = variance_within(&logarithms);
    curves.points.iter_mut().for_each(|points| use_median_seconds(points));
    Ok(curves)
}

/// The seconds of the points of each sample count.
fn seconds_by_count(points: &[Point]) -> Vec<Vec<f64>> {
    let spps: BTreeSet<u32> = points.iter().map(|point| point.spp).collect();
    let of_count = |spp| points.iter().filter(|point| point.spp == spp).map(|point| point.seconds).collect();
    spps.into_iter().map(of_count).collect()
}

/// Replaces the seconds of all points with the same sample count by their median. Seeds do not differ in speed,
/// but the load of the machine does.
pub fn use_median_seconds(points: &mut [Point]) {
    let spps: BTreeSet<u32> = points.iter().map(|point| point.spp).collect();
    for spp in spps {
        let seconds = median(points.iter().filter(|p| p.spp == spp).map(|p| p.seconds));
        points.iter_mut().filter(|p| p.spp == spp).for_each(|p| p.seconds = seconds);
    }
}

/// The cost that is equal where two errors are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EqualCost {
    Samples,
    Seconds,
}

/// Ratios of the points' errors to the errors of a curve at equal cost, seed by seed.
pub fn ratios(points: &[Point], curve_points: &[Point], equal: EqualCost, error: Metric) -> Vec<f64> {
    let x = |point: &Point| match equal {
        EqualCost::Samples => f64::from(point.spp),
        EqualCost::Seconds => point.seconds,
    };
    let ratio = |point: &Point| {
        error(point) / interpolate_log_log(&curve(curve_points, Some(point.seed), x, error), x(point))
    };
    points.iter().map(ratio).collect()
}

/// Variance of the logarithm of a ratio at equal seconds, of points with one sample count, that comes from the clock: from the
/// median times of both sides.
pub fn clock_variance_of_ratio(
    points: &[Point],
    curve_points: &[Point],
    error: Metric,
    clock_variance: f64,
) -> f64 {
    let Some(Point { seconds, .. }) = points.first() else { return 0.0 };
    let slope = slope_log_log(&curve(curve_points, None, |point| point.seconds, error), *seconds);
    // The median of n values has at most about π/2 times the variance of their mean
    2.0 * slope * slope * clock_variance * std::f64::consts::FRAC_PI_2 / points.len() as f64
}

/// Runs a trial, or returns its recorded values. `name` tells it from other trials with the same sample count
/// and seed.
pub fn measure_trial(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    trial: &Trial,
    name: &str,
) -> anyhow::Result<Values> {
    let (spp, seed) = (trial.spp, trial.seed);
    session.show_status(format!("{}: {name}, {spp} spp, seed {seed}", test_scene.name));
    let reference = test_scene.reference.spp;
    let (width, height) = (test_scene.reference.image.width(), test_scene.reference.image.height());
    let target = trial.target_error.map_or_else(String::new, |target| format!(" target-error={target}"));
    let settings =
        format!("configuration={name:?} spp={spp}{target} size={width}x{height} reference-spp={reference}");
    session.ledger.measure(Key::new(&test_scene.name, seed, settings), &[], || {
        let rendered = trial.run(test_scene, accel);
        let [render, filter, allocate] = rendered.seconds;
        let mut measured =
            values([("seconds", render + filter + allocate), ("seconds of samples", render + allocate)]);
        for (name, image) in [("", &rendered.result.image), ("unfiltered ", &rendered.unfiltered())] {
            let errors = test_scene.errors(image);
            measured.extend(errors.into_iter().map(|(error, value)| (format!("{name}{error}"), value)));
        }
        if let Some(estimate) = &rendered.estimate {
            measured.extend(EstimateCheck::measure(estimate, &rendered.result.image, test_scene));
        }
        let halving_seconds = rendered.forecast.map(|forecast| forecast.halving_seconds);
        measured.extend(halving_seconds.map(|seconds| ("halving seconds".to_owned(), seconds)));
        let is_reached = f64::from(rendered.stopped_by == StoppedBy::TargetError);
        let passes = rendered.passes as f64;
        measured.extend(values([("passes", passes), ("target reached", is_reached)]));
        Ok(measured)
    })
}

/// The curve of a seed, or the mean over all seeds if `None`: (x, error), ascending in sample counts.
pub fn curve(
    points: &[Point],
    seed: Option<u64>,
    x: impl Fn(&Point) -> f64,
    error: Metric,
) -> Vec<(f64, f64)> {
    let spps: BTreeSet<u32> = points.iter().map(|point| point.spp).collect();
    let mean_point = |spp: u32| {
        let chosen: Vec<&Point> = points
            .iter()
            .filter(|point| point.spp == spp && seed.is_none_or(|seed| point.seed == seed))
            .collect();
        let mean = |value: &dyn Fn(&Point) -> f64| {
            chosen.iter().map(|p| value(p)).sum::<f64>() / chosen.len() as f64
        };
        (mean(&x), mean(&error))
    };
    spps.into_iter().map(mean_point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(spp: u32, seed: u64, seconds: f64, error: f64) -> Point {
        Point { spp, seed, seconds, error, trimmed: error, flip: error, halving_seconds: None }
    }

    #[test]
    fn curves_are_means_over_seeds_or_those_of_one() {
        let point = |spp, seed, error| point(spp, seed, f64::from(spp), error);
        let points = [point(16, 0, 0.1), point(8, 0, 0.4), point(16, 1, 0.3), point(8, 1, 0.2)];
        let mean = curve(&points, None, |p| p.seconds, |p| p.error);
        assert_eq!(mean.iter().map(|p| p.0).collect::<Vec<_>>(), [8.0, 16.0]);
        assert!(mean.iter().zip([0.3, 0.2]).all(|(p, e)| (p.1 - e).abs() < 1e-12));
        assert_eq!(curve(&points, Some(1), |p| p.seconds, |p| p.error), [(8.0, 0.2), (16.0, 0.3)]);
    }

    #[test]
    fn errors_are_compared_at_equal_samples_or_at_equal_seconds() {
        let point = |spp, seconds, error| point(spp, 0, seconds, error);
        let uniform = [point(8, 1.0, 0.8), point(16, 2.0, 0.4)];
        let adaptive = [point(8, 2.0, 0.4)];
        assert!((ratios(&adaptive, &uniform, EqualCost::Samples, |p| p.error)[0] - 0.5).abs() < 1e-12);
        assert!((ratios(&adaptive, &uniform, EqualCost::Seconds, |p| p.error)[0] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_clock_makes_ratios_as_uncertain_as_the_curve_is_steep() {
        let curve = |power: i32| [1.0_f64, 4.0].map(|seconds| point(8, 0, seconds, seconds.powi(-power)));
        let curve = |power| {
            let [first, last] = curve(power);
            [first, Point { spp: 32, ..last }]
        };
        let adaptive = [2.0; 4].map(|seconds| point(16, 0, seconds, 0.1));
        let variance = |power| clock_variance_of_ratio(&adaptive, &curve(power), |p| p.error, 0.01);
        let expected = 2.0 * 0.01 * std::f64::consts::FRAC_PI_2 / 4.0;
        assert!((variance(1) - expected).abs() < 1e-9 && (variance(2) - 4.0 * expected).abs() < 1e-9);
        assert_eq!(seconds_by_count(&curve(1)), [[1.0], [4.0]]);
    }

    #[test]
    fn points_of_a_sample_count_get_the_median_of_their_seconds() {
        let mut points: Vec<Point> = [1.0, 9.0, 2.0]
            .into_iter()
            .enumerate()
            .map(|(seed, seconds)| point(8, seed as u64, seconds, 0.1))
            .collect();
        use_median_seconds(&mut points);
        assert!(points.iter().all(|point| point.seconds == 2.0));
    }
}
