//! Adaptive renders in which only each so-many-th rerun of the filter takes place.

use prpf::adaptive::Sampling;
use prpf::geometry::Accel;
use prpf::progressive::Denoiser;

use super::{Measured, RerunSettings};
use crate::bench::Bench;
use crate::curves::{self, Equal, Point, ratios};
use crate::report::{Report, number};
use crate::statistics::geometric_mean;
use crate::trial::{Bed, Steering, Trial};

/// Points of each of `settings.every`.
pub fn measure(
    bench: &mut Bench,
    bed: &Bed,
    accel: &Accel,
    settings: &RerunSettings,
) -> anyhow::Result<Vec<Vec<Point>>> {
    let spp = settings.spp;
    let mut measured = Vec::new();
    for &every in &settings.every {
        let mut points = Vec::new();
        for seed in 0..settings.seeds {
            let steering = if every > 1 { Steering::Seldom(every) } else { Steering::None };
            let trial = Trial { steering, ..Trial::new(Sampling::Adaptive, Denoiser::Prpf, spp, seed) };
            let name = format!("a rerun after every {every} batches");
            let values = curves::take(bench, bed, accel, &trial, &name)?;
            points.push(Point { spp, seed, seconds: values["seconds"], error: values["relmse"] });
        }
        curves::level_seconds(&mut points);
        measured.push(points);
    }
    Ok(measured)
}

/// Writes the section.
pub fn write(report: &mut Report, settings: &RerunSettings, all: &[Measured]) {
    report.section("Reruns of the filter between batches");
    report.paragraph(&format!(
        "Adaptive renders of {} samples per pixel in the program's batches, where only each so-many-th batch is followed \
         by a rerun of the filter; maps drive the samples until newer ones are there. Seconds and relMSE over those of a \
         rerun after every batch, at equal samples, geometric means over the scenes (95 % interval):",
        settings.spp
    ));
    let over_scenes = |of: &dyn Fn(&Measured) -> f64| {
        let mean = geometric_mean(&all.iter().map(of).collect::<Vec<_>>());
        let [mean, low, high] = [mean.mean, mean.low, mean.high].map(|value| number(value, 3));
        format!("{mean} ({low} to {high})")
    };
    let row = |i: usize| {
        let seconds = |m: &Measured, i: usize| m.reruns[i].first().map_or(f64::NAN, |point| point.seconds);
        let error = |m: &Measured| geometric_mean(&ratios(&m.reruns[i], &m.reruns[0], Equal::Samples)).mean;
        vec![
            settings.every[i].to_string(),
            over_scenes(&|m| seconds(m, i) / seconds(m, 0)),
            over_scenes(&error),
        ]
    };
    let rows: Vec<_> = (0..settings.every.len()).map(row).collect();
    report.table(&["rerun after every … batches", "seconds", "relMSE"], &rows);
}
