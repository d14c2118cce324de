//! Measures renders that end by their estimated error (`--target-error`): is the true error what was asked for?

use prpf::adaptive::Sampling;
use prpf::filter::DENOISERS;
use prpf::geometry::Accel;

use super::scene_results::SceneResults;
use super::settings::TargetErrorSettings;
use crate::curves::measure_trial;
use crate::report::{Report, median, number, range};
use crate::session::Session;
use crate::test_scene::{TestScene, groups};
use crate::trial::Trial;

/// A true error this many times the target, or within, is what was asked for.
const ACCEPTED: [f64; 2] = [0.5, 1.5];

/// A render with a target.
#[derive(Clone, Copy, Debug)]
pub struct TargetRun {
    target: f64,
    /// relMSE of the image over the target.
    ratio: f64,
    end: End,
}

/// What ended a render with a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// The estimate of the first image, which may be far better than the target.
    FirstImage,
    LaterImage,
    /// The largest number of samples.
    Samples,
}

impl TargetRun {
    fn is_accepted(&self) -> bool {
        (ACCEPTED[0]..=ACCEPTED[1]).contains(&self.ratio)
    }
}

/// Measures the default denoiser with each target and seed.
pub fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    settings: &TargetErrorSettings,
) -> anyhow::Result<Vec<TargetRun>> {
    let mut runs = Vec::new();
    for (&target, seed) in
        settings.targets.iter().flat_map(|target| (0..settings.seeds).map(move |s| (target, s)))
    {
        let trial = Trial {
            target_error: Some(target),
            ..Trial::new(Sampling::Adaptive, DENOISERS[0], settings.max_spp, seed)
        };
        let values = measure_trial(session, test_scene, accel, &trial, "to a target error")?;
        // The first interim pass and the last one
        let is_first_image = values["passes"] <= 2.0;
        let end = match (values["target reached"] > 0.0, is_first_image) {
            (false, _) => End::Samples,
            (true, true) => End::FirstImage,
            (true, false) => End::LaterImage,
        };
        runs.push(TargetRun { target, ratio: values["relmse"] / target, end });
    }
    Ok(runs)
}

/// Runs that the estimate has ended with a later image than the first.
fn runs_to_judge(scenes: &[&SceneResults]) -> Vec<TargetRun> {
    let runs = scenes.iter().flat_map(|m| &m.target_runs);
    runs.filter(|run| run.end == End::LaterImage).copied().collect()
}

/// The finding, in a sentence.
pub fn finding(all: &[SceneResults]) -> String {
    let of_group = |(name, scenes): (&str, Vec<&SceneResults>)| {
        let runs = runs_to_judge(&scenes);
        let accepted = runs.iter().filter(|run| run.is_accepted()).count();
        let ratios = || runs.iter().map(|run| run.ratio);
        format!(
            "on {name} {} times the target in the median ({}), within {} to {} times in {accepted} of {} renders",
            number(median(ratios()), 2),
            range(ratios(), 2),
            ACCEPTED[0],
            ACCEPTED[1],
            runs.len()
        )
    };
    let parts: Vec<String> = groups(all, |m| m.is_public).into_iter().map(of_group).collect();
    format!("`--target-error` ended renders at a true error {}.", parts.join("; "))
}

/// Writes the section.
pub fn write(report: &mut Report, settings: &TargetErrorSettings, all: &[SceneResults]) {
    report.section("Does `--target-error` end at the error that was asked for?");
    report.paragraph(&format!(
        "True relMSE over the target, by seed, adaptive and filtered with the default denoiser. `<`: the first image with an \
         estimate was good enough, and may be far better; such a render is not judged. `>`: {} samples per pixel were not \
         enough. Judged are the others, which should end between {} and {} times the target.",
        settings.max_spp, ACCEPTED[0], ACCEPTED[1]
    ));
    let cell = |run: &TargetRun| {
        let sign = match run.end {
            End::FirstImage => "< ",
            End::LaterImage => "",
            End::Samples => "> ",
        };
        format!("{sign}{}", number(run.ratio, 2))
    };
    let row = |m: &SceneResults| {
        let cells = settings.targets.iter().map(|&target| {
            let runs = m.target_runs.iter().filter(|run| run.target == target);
            runs.map(cell).collect::<Vec<_>>().join(", ")
        });
        std::iter::once(m.scene.clone()).chain(cells).collect::<Vec<_>>()
    };
    let targets: Vec<String> = settings.targets.iter().map(f64::to_string).collect();
    let head: Vec<&str> = std::iter::once("scene").chain(targets.iter().map(String::as_str)).collect();
    report.table(&head, &all.iter().map(row).collect::<Vec<_>>());
}
