//! What does accuracy cost in time? Seconds to an error, the filters' settings, the reruns of the filter
//! between batches, and whether the error that the loop shows is the true one.

mod agreement;
mod filters;
mod front;
mod report;
mod reruns;
mod times;

use anyhow::ensure;
use prpf::geometry::Accel;
use serde::Deserialize;

use crate::bench::Bench;
use crate::curves::{self, Curves, Point};
use crate::trial::{Bed, Size};

use filters::Cost;

/// `accuracy.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    scenes: Vec<String>,
    size: Size,
    targets: Vec<f64>,
    curves: CurveSettings,
    reruns: RerunSettings,
    filters: filters::Settings,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CurveSettings {
    spp: Vec<u32>,
    seeds: u64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RerunSettings {
    spp: u32,
    every: Vec<usize>,
    seeds: u64,
}

/// What was measured on a scene.
struct Measured {
    scene: String,
    reference_error: f64,
    curves: Curves,
    /// Of each choice of [`filters::Settings::choices`].
    filters: Vec<Cost>,
    /// Of each value of `reruns.every`.
    reruns: Vec<Vec<Point>>,
}

pub fn run(bench: &mut Bench) -> anyhow::Result<()> {
    let settings: Settings = bench.settings()?;
    ensure!(settings.curves.spp.len() >= 2, "curves.spp: accepted are two values or more");
    let mut all = Vec::new();
    for file in bench.scenes(&settings.scenes)? {
        let bed = Bed::new(bench, &file, &settings.size)?;
        let accel = Accel::build(&bed.scene);
        let filters = filters::measure(bench, &bed, &accel, &settings.filters)?;
        let reruns = reruns::measure(bench, &bed, &accel, &settings.reruns)?;
        let CurveSettings { spp, seeds } = &settings.curves;
        let curves = curves::measure(bench, &bed, &accel, (spp, *seeds), spp.last().copied())?;
        let (scene, reference_error) = (bed.name, bed.reference.relmse);
        all.push(Measured { scene, reference_error, curves, filters, reruns });
    }
    report::write(bench, &settings, &all)
}
