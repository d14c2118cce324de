//! Error against samples and seconds of the four ways to an image: uniform or adaptive, unfiltered or
//! filtered. Measurements are kept in the ledger; what the loop says of its error is among them.

use std::collections::BTreeSet;

use prpf::adaptive::Sampling;
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::progressive::{Denoiser, TILE};

use crate::bench::Bench;
use crate::ledger::{Key, Values, values};
use crate::report::median;
use crate::statistics::{on_curve, rank_correlation};
use crate::trial::{Bed, Trial};

/// A way to an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    pub sampling: Sampling,
    pub filtered: bool,
}

/// All of them.
pub const WAYS: [Way; 4] = [
    Way { sampling: Sampling::Uniform, filtered: false },
    Way { sampling: Sampling::Adaptive, filtered: false },
    Way { sampling: Sampling::Uniform, filtered: true },
    Way { sampling: Sampling::Adaptive, filtered: true },
];

impl Way {
    pub fn name(self) -> &'static str {
        match (self.sampling, self.filtered) {
            (Sampling::Uniform, false) => "uniform, unfiltered",
            (Sampling::Adaptive, false) => "adaptive, unfiltered",
            (Sampling::Uniform, true) => "uniform, filtered",
            (Sampling::Adaptive, true) => "adaptive, filtered",
        }
    }
}

/// An image's cost and error.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub spp: u32,
    pub seed: u64,
    pub seconds: f64,
    pub error: f64,
}

/// What the loop said of an image's error, in numbers.
#[derive(Clone, Copy, Debug)]
pub struct Checked {
    /// Samples per pixel of the image.
    pub spp: f64,
    pub estimate: f64,
    /// Of the estimate, as it says itself.
    pub standard_error: f64,
    pub truth: f64,
    /// Spearman's correlation of estimate and truth over tiles.
    pub rank_correlation: f64,
}

/// Points of each of [`WAYS`], and the checks of both filtered ones: uniform, adaptive.
#[derive(Default)]
pub struct Curves {
    pub points: [Vec<Point>; 4],
    pub checks: [Vec<Checked>; 2],
}

/// Measures all ways to a scene's image at some sample counts, ascending; at one of them, if asked for, also
/// what the loop says of its error. The unfiltered uniform image is that of the filtered one's samples, and takes
/// the time of these.
pub fn measure(
    bench: &mut Bench,
    bed: &Bed,
    accel: &Accel,
    (spps, seeds): (&[u32], u64),
    checked: Option<u32>,
) -> anyhow::Result<Curves> {
    let mut curves = Curves::default();
    for (seed, &spp) in (0..seeds).flat_map(|seed| spps.iter().map(move |spp| (seed, spp))) {
        for (i, way) in WAYS.iter().enumerate().skip(1) {
            let denoiser = if way.filtered { Denoiser::Prpf } else { Denoiser::None };
            let trial = Trial {
                checked: Some(&spp) == checked.as_ref(),
                ..Trial::new(way.sampling, denoiser, spp, seed)
            };
            let measured = take(bench, bed, accel, &trial, way.name())?;
            let point = |error: &str, seconds: &str| Point {
                spp,
                seed,
                seconds: measured[seconds],
                error: measured[error],
            };
            curves.points[i].push(point("relmse", "seconds"));
            if way.sampling == Sampling::Uniform {
                curves.points[0].push(point("unfiltered relmse", "seconds of samples"));
            }
            if way.filtered {
                curves.checks[usize::from(way.sampling == Sampling::Adaptive)].extend(checks(&measured));
            }
        }
    }
    curves.points.iter_mut().for_each(|points| level_seconds(points));
    Ok(curves)
}

/// Gives all seeds of a sample count the median of their seconds: seeds do not differ in speed, but what else
/// runs on the machine does.
pub fn level_seconds(points: &mut [Point]) {
    let spps: BTreeSet<u32> = points.iter().map(|point| point.spp).collect();
    for spp in spps {
        let seconds = median(points.iter().filter(|p| p.spp == spp).map(|p| p.seconds));
        points.iter_mut().filter(|p| p.spp == spp).for_each(|p| p.seconds = seconds);
    }
}

/// What two ways have in common when their errors are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Equal {
    Samples,
    Seconds,
}

/// Errors of some points over those of a curve at equal samples or seconds, seed by seed.
pub fn ratios(points: &[Point], curve_points: &[Point], equal: Equal) -> Vec<f64> {
    let x = |point: &Point| match equal {
        Equal::Samples => f64::from(point.spp),
        Equal::Seconds => point.seconds,
    };
    let ratio = |point: &Point| point.error / on_curve(&curve(curve_points, Some(point.seed), x), x(point));
    points.iter().map(ratio).collect()
}

/// Runs a trial, or finds what it gave. `name`: what tells it from all others of the same sample count.
pub fn take(
    bench: &mut Bench,
    bed: &Bed,
    accel: &Accel,
    trial: &Trial,
    name: &str,
) -> anyhow::Result<Values> {
    let (spp, seed) = (trial.spp, trial.seed);
    bench.doing(format!("{}: {name}, {spp} spp, seed {seed}", bed.name));
    let reference = bed.reference.spp;
    let (width, height) = (bed.reference.image.width(), bed.reference.image.height());
    let settings = format!("way={name:?} spp={spp} size={width}x{height} reference-spp={reference}");
    bench.ledger.measure(Key::new(&bed.name, seed, settings), &[], || {
        let rendered = trial.run(bed, accel);
        let [render, filter, allocate] = rendered.seconds;
        let mut measured = values([
            ("relmse", bed.error(&rendered.filtered.image)),
            ("unfiltered relmse", bed.error(&rendered.unfiltered())),
            ("seconds", render + filter + allocate),
            ("seconds of samples", render + allocate),
        ]);
        for (i, check) in rendered.checks.iter().enumerate() {
            let (tiles, mean) = true_tiles(&check.image, &bed.reference.image);
            let estimated: Vec<f64> = check.estimate.tiles.plane(0).iter().map(|&v| f64::from(v)).collect();
            let numbers = [
                ("spp", check.spp),
                ("estimate", check.estimate.image),
                ("standard error", check.estimate.standard_error),
                ("truth", (mean - bed.reference.relmse).max(f64::MIN_POSITIVE)),
                ("rank correlation", rank_correlation(&estimated, &tiles)),
            ];
            measured.extend(numbers.map(|(name, value)| (check_name(i, name), value)));
        }
        Ok(measured)
    })
}

fn check_name(index: usize, quantity: &str) -> String {
    format!("check {index}: {quantity}")
}

fn checks(measured: &Values) -> Vec<Checked> {
    let number = |i: usize, name: &str| measured.get(&check_name(i, name)).copied();
    let check = |i: usize| {
        Some(Checked {
            spp: number(i, "spp")?,
            estimate: number(i, "estimate")?,
            standard_error: number(i, "standard error")?,
            truth: number(i, "truth")?,
            rank_correlation: number(i, "rank correlation")?,
        })
    };
    (0..).map_while(check).collect()
}

/// relMSE by the tiles of the loop's estimate, and of the image.
fn true_tiles(image: &Planes, reference: &Planes) -> (Vec<f64>, f64) {
    let (width, columns) = (image.width(), image.width().div_ceil(TILE));
    let tiles = columns * image.height().div_ceil(TILE);
    let (mut sums, mut counts) = (vec![0.0; tiles], vec![0.0; tiles]);
    for (i, error) in squared_error(image, reference).into_iter().enumerate() {
        let tile = i / width / TILE * columns + i % width / TILE;
        sums[tile] += error;
        counts[tile] += 1.0;
    }
    let mean = sums.iter().sum::<f64>() / counts.iter().sum::<f64>();
    (sums.iter().zip(counts).map(|(sum, count)| sum / count).collect(), mean)
}

/// Each pixel's part in relMSE.
pub fn squared_error(image: &Planes, reference: &Planes) -> Vec<f64> {
    /// As in the library's relMSE.
    const FLOOR: f64 = 0.01;
    let of = |i: usize, c: usize| {
        let (x, r) = (f64::from(image.plane(c)[i]), f64::from(reference.plane(c)[i]));
        (x - r).powi(2) / (r * r + FLOOR)
    };
    (0..image.pixels()).map(|i| (0..3).map(|c| of(i, c)).sum::<f64>() / 3.0).collect()
}

/// A seed's curve, or of `None` the seeds' mean: (spp, error) or (seconds, error), ascending.
pub fn curve(points: &[Point], seed: Option<u64>, x: impl Fn(&Point) -> f64) -> Vec<(f64, f64)> {
    let spps: BTreeSet<u32> = points.iter().map(|point| point.spp).collect();
    let at = |spp: u32| {
        let chosen: Vec<&Point> = points
            .iter()
            .filter(|point| point.spp == spp && seed.is_none_or(|seed| point.seed == seed))
            .collect();
        let mean =
            |of: &dyn Fn(&Point) -> f64| chosen.iter().map(|p| of(p)).sum::<f64>() / chosen.len() as f64;
        (mean(&x), mean(&|point| point.error))
    };
    spps.into_iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prpf::image::metrics::Pair;

    fn planes(value: impl Fn(usize) -> f32) -> Planes {
        let mut planes = Planes::new(20, 18, 3);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = value(i));
        planes
    }

    #[test]
    fn tiles_add_up_to_the_library_s_relmse() {
        let (image, reference) = (planes(|i| (i % 7) as f32), planes(|i| (i % 5) as f32));
        let (tiles, mean) = true_tiles(&image, &reference);
        assert_eq!(tiles.len(), 4);
        assert!((mean - Pair::new(&image, &reference).unwrap().relmse()).abs() < 1e-9 * mean);
    }

    #[test]
    fn curves_are_means_over_seeds_or_those_of_one() {
        let point = |spp, seed, error| Point { spp, seed, seconds: f64::from(spp), error };
        let points = [point(16, 0, 0.1), point(8, 0, 0.4), point(16, 1, 0.3), point(8, 1, 0.2)];
        let of_mean = curve(&points, None, |p| p.seconds);
        assert_eq!(of_mean.iter().map(|p| p.0).collect::<Vec<_>>(), [8.0, 16.0]);
        assert!(of_mean.iter().zip([0.3, 0.2]).all(|(p, e)| (p.1 - e).abs() < 1e-12));
        assert_eq!(curve(&points, Some(1), |p| p.seconds), [(8.0, 0.2), (16.0, 0.3)]);
    }

    #[test]
    fn errors_are_compared_at_equal_samples_or_at_equal_seconds() {
        let point = |spp, seconds, error| Point { spp, seed: 0, seconds, error };
        let uniform = [point(8, 1.0, 0.8), point(16, 2.0, 0.4)];
        let adaptive = [point(8, 2.0, 0.4)];
        assert!((ratios(&adaptive, &uniform, Equal::Samples)[0] - 0.5).abs() < 1e-12);
        assert!((ratios(&adaptive, &uniform, Equal::Seconds)[0] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn seeds_share_the_median_of_their_seconds() {
        let mut points: Vec<Point> = [1.0, 9.0, 2.0]
            .into_iter()
            .enumerate()
            .map(|(seed, seconds)| Point { spp: 8, seed: seed as u64, seconds, error: 0.1 })
            .collect();
        level_seconds(&mut points);
        assert!(points.iter().all(|point| point.seconds == 2.0));
    }
}
