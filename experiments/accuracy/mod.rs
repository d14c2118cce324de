//! The experiment `accuracy`: what does accuracy cost in time?
//!
//! Measures the seconds to reach an error, cost and error of the filters' settings, the effect of fewer interim
//! passes, and how well the loop's error estimates agree with the true error.

mod agreement;
mod filter_costs;
mod filter_variant;
mod interim_passes;
mod pareto_front;
mod report;
mod times;

use anyhow::ensure;
use prpf::geometry::Accel;
use serde::Deserialize;

use crate::curves::{self, Curves, Point};
use crate::session::Session;
use crate::test_scene::{Size, TestScene};

use filter_costs::Cost;

/// `accuracy.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    scenes: Vec<String>,
    size: Size,
    targets: Vec<f64>,
    curves: CurveSettings,
    interim_passes: InterimPassSettings,
    filters: filter_costs::Settings,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CurveSettings {
    spp: Vec<u32>,
    seeds: u64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct InterimPassSettings {
    spp: u32,
    every: Vec<usize>,
    seeds: u64,
}

/// The measurements on a scene.
struct SceneResults {
    scene: String,
    reference_relmse: f64,
    curves: Curves,
    /// By index of [`filter_costs::Settings::variants`].
    filters: Vec<Cost>,
    /// By index of `interim_passes.every`.
    interim_passes: Vec<Vec<Point>>,
}

/// Runs the experiment.
pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let settings: Settings = session.settings()?;
    ensure!(settings.curves.spp.len() >= 2, "curves.spp: accepted are two values or more");
    let mut all = Vec::new();
    for file in session.scenes(&settings.scenes)? {
        let test_scene = TestScene::new(session, &file, &settings.size)?;
        let accel = Accel::build(&test_scene.scene);
        let filters = filter_costs::measure(session, &test_scene, &accel, &settings.filters)?;
        let interim_passes = interim_passes::measure(session, &test_scene, &accel, &settings.interim_passes)?;
        let CurveSettings { spp, seeds } = &settings.curves;
        let curves = curves::measure(session, &test_scene, &accel, (spp, *seeds), spp.last().copied())?;
        let (scene, reference_relmse) = (test_scene.name, test_scene.reference.relmse);
        all.push(SceneResults { scene, reference_relmse, curves, filters, interim_passes });
    }
    report::write(session, &settings, &all)
}
