//! The experiment `accuracy`: what does accuracy cost in time?
//!
//! Measures the seconds to reach an error, cost and error of the filters' settings, the effect of fewer interim
//! passes, and how well the loop's error estimates agree with the true error: for an image, for the price of half
//! its error, and where they end a render.

mod agreement;
mod filter_costs;
mod filter_variant;
mod halving;
mod interim_passes;
mod pareto_front;
mod report;
mod scene_results;
mod settings;
mod target_errors;
mod times;

use anyhow::ensure;
use prpf::geometry::Accel;

use crate::curves::{self, Counts};
use crate::session::Session;
use crate::test_scene::TestScene;
use scene_results::SceneResults;
use settings::{CurveSettings, Settings};

/// Runs the experiment.
pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let settings: Settings = session.settings()?;
    let CurveSettings { spp, seeds } = &settings.curves;
    ensure!(
        spp.len() >= 2 && *seeds > 0,
        "accuracy.toml: curves.spp needs two values or more, curves.seeds one"
    );
    let mut all = Vec::new();
    for file in session.scenes(&settings.scenes)? {
        let test_scene = TestScene::new(session, &file, &settings.size)?;
        let accel = Accel::build(&test_scene.scene);
        let filters = filter_costs::measure(session, &test_scene, &accel, &settings.filters)?;
        let interim_passes = interim_passes::measure(session, &test_scene, &accel, &settings.interim_passes)?;
        let counts = Counts { spp, more_uniform_spp: &[], seeds: *seeds };
        let curves = curves::measure(session, &test_scene, &accel, &counts)?;
        let target_runs = target_errors::measure(session, &test_scene, &accel, &settings.target_errors)?;
        let TestScene { name: scene, is_public, reference, .. } = test_scene;
        let reference_relmse = reference.relmse;
        all.push(SceneResults {
            scene,
            is_public,
            reference_relmse,
            curves,
            filters,
            interim_passes,
            target_runs,
        });
    }
    report::write(session, &settings, &all)
}
