//! Is adaptive sampling better than uniform? Error against samples and against seconds, on several
//! scenes, with several seeds; and which of the driving maps earns its place.

mod drives;
mod pictures;
mod report;

use anyhow::ensure;
use prpf::geometry::Accel;
use serde::Deserialize;

use crate::bench::Bench;
use crate::curves::{self, Curves, Point};
use crate::trial::{Bed, Size};

use drives::Drive;

/// `allocation.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    scenes: Vec<String>,
    size: Size,
    spp: Vec<u32>,
    seeds: u64,
    maps: MapSettings,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct MapSettings {
    spp: u32,
    seeds: u64,
}

/// What was measured on a scene.
struct Measured {
    scene: String,
    /// Relative MSE that the reference has itself.
    reference_error: f64,
    curves: Curves,
    /// Error over uniform's with the best allocation for unfiltered images.
    ceiling: f64,
    drives: Vec<(Drive, Vec<Point>)>,
    picture: String,
}

pub fn run(bench: &mut Bench) -> anyhow::Result<()> {
    let settings: Settings = bench.settings()?;
    ensure!(
        settings.spp.len() >= 2
            && settings.spp.contains(&settings.maps.spp)
            && settings.maps.seeds <= settings.seeds,
        "accepted are two values of spp or more, maps.spp among them, and maps.seeds up to seeds"
    );
    let mut all = Vec::new();
    for file in bench.scenes(&settings.scenes)? {
        let bed = Bed::new(bench, &file, &settings.size)?;
        let accel = Accel::build(&bed.scene);
        let curves = curves::measure(bench, &bed, &accel, (&settings.spp, settings.seeds), None)?;
        let drives = drives::measure(bench, &bed, &accel, settings.maps)?;
        let (picture, ceiling) = pictures::take(bench, &bed, &accel, settings.maps.spp)?;
        let (scene, reference_error) = (bed.name, bed.reference.relmse);
        all.push(Measured { scene, reference_error, curves, ceiling, drives, picture });
    }
    report::write(bench, &settings, &all)
}
