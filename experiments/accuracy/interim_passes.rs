//! Measures adaptive renders in which only every n-th batch is followed by an interim pass of the filter.

use prpf::adaptive::Sampling;
use prpf::filter::DEFAULT;
use prpf::geometry::Accel;

use super::scene_results::SceneResults;
use super::settings::InterimPassSettings;
use crate::curves::{self, EqualCost, Point, ratios};
use crate::report::{Report, number};
use crate::session::Session;
use crate::statistics::geometric_mean;
use crate::test_scene::TestScene;
use crate::trial::{InterimPasses, Trial};

/// Measures the renders; gives their points by index of `settings.every`.
pub fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    settings: &InterimPassSettings,
) -> anyhow::Result<Vec<Vec<Point>>> {
    let spp = settings.spp;
    let mut measured = Vec::new();
    for &every in &settings.every {
        let mut points = Vec::new();
        for seed in 0..settings.seeds {
            let interim_passes =
                if every > 1 { InterimPasses::EveryNth(every) } else { InterimPasses::EveryBatch };
            let trial = Trial { interim_passes, ..Trial::new(Sampling::Adaptive, DEFAULT, spp, seed) };
            let name = format!("an interim pass after every {every} batches");
            let values = curves::measure_trial(session, test_scene, accel, &trial, &name)?;
            points.push(Point::new(&trial, &values));
        }
        curves::use_median_seconds(&mut points);
        measured.push(points);
    }
    Ok(measured)
}

/// Writes the section.
pub fn write(report: &mut Report, settings: &InterimPassSettings, all: &[SceneResults]) {
    report.section("Interim passes");
    report.paragraph(&format!(
        "Adaptive renders of {} samples per pixel in the program's batches, where only every n-th batch is followed by \
         an interim pass of the filter; in between, the allocator uses the previous maps. Ratios of seconds and relMSE \
         to those with a pass after every batch, at equal samples, geometric means over the scenes (95 % interval):",
        settings.spp
    ));
    let over_scenes = |ratio: &dyn Fn(&SceneResults) -> f64| {
        let mean = geometric_mean(&all.iter().map(ratio).collect::<Vec<_>>());
        let [mean, low, high] = [mean.mean, mean.low, mean.high].map(|value| number(value, 3));
        format!("{mean} ({low} to {high})")
    };
    let row = |i: usize| {
        let seconds =
            |m: &SceneResults, i: usize| m.interim_passes[i].first().map_or(f64::NAN, |point| point.seconds);
        let error = |m: &SceneResults| {
            let [points, others] = [i, 0].map(|i| &m.interim_passes[i]);
            geometric_mean(&ratios(points, others, EqualCost::Samples, |p| p.error)).mean
        };
        vec![
            settings.every[i].to_string(),
            over_scenes(&|m| seconds(m, i) / seconds(m, 0)),
            over_scenes(&error),
        ]
    };
    let rows: Vec<_> = (0..settings.every.len()).map(row).collect();
    report.table(&["batches per interim pass", "seconds", "relMSE"], &rows);
}
