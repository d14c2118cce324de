//! Measures renders that end by their estimated error (`--target-error`): is the true error what was asked for?

use prpf::adaptive::Sampling;
use prpf::filter::DEFAULT;
use prpf::geometry::Accel;

use super::scene_results::SceneResults;
use super::settings::TargetErrorSettings;
use crate::curves::measure_trial;
use crate::report::{Goal, Report, median, number, range};
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
            ..Trial::new(Sampling::Adaptive, DEFAULT, settings.max_spp, seed)
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

/// Runs that the estimate has ended. A first image counts only if it misses its target: one that does not may be good by chance alone, as
/// those are that are far better, and to count some of them would make the estimate look better than it is.
fn runs_to_judge<'a>(scenes: impl IntoIterator<Item = &'a SceneResults>) -> Vec<TargetRun> {
    let runs = scenes.into_iter().flat_map(|m| &m.target_runs);
    let is_judged = |run: &&TargetRun| match run.end {
        End::FirstImage => run.ratio > ACCEPTED[1],
        End::LaterImage => true,
        End::Samples => false,
    };
    runs.filter(is_judged).copied().collect()
}

/// The finding, in a sentence.
pub fn finding(all: &[SceneResults]) -> String {
    let of_group = |(name, scenes): (&str, Vec<&SceneResults>)| {
        let runs = runs_to_judge(scenes.iter().copied());
        let accepted = runs.iter().filter(|run| run.is_accepted()).count();
        let ratios = || runs.iter().map(|run| run.ratio);
        let ended_by = |end| {
            let runs = scenes.iter().flat_map(|m| &m.target_runs).filter(|run| run.end == end);
            let ratios: Vec<f64> = runs.map(|run| run.ratio).collect();
            let of_target = || format!(" at {} times the target", range(ratios.iter().copied(), 2));
            format!("{}{}", ratios.len(), if ratios.is_empty() { String::new() } else { of_target() })
        };
        format!(
            "on {name} {} times the target in the median ({}), within {} to {} times in {accepted} of {} renders; {} ended with the first \
             image, {} with the largest number of samples",
            number(median(ratios()), 2),
            range(ratios(), 2),
            ACCEPTED[0],
            ACCEPTED[1],
            runs.len(),
            ended_by(End::FirstImage),
            ended_by(End::Samples),
        )
    };
    let parts: Vec<String> = groups(all, |m| m.is_public).into_iter().map(of_group).collect();
    format!("`--target-error` ended renders at a true error {}.", parts.join("; "))
}

/// The goal, beside what was measured.
pub fn goal(all: &[SceneResults]) -> Goal {
    const FRACTION: f64 = 0.9;
    let runs = runs_to_judge(all);
    let accepted = runs.iter().filter(|run| run.is_accepted()).count();
    Goal {
        goal: format!(
            "`--target-error` ends at {} to {} times the target in {:.0} %",
            ACCEPTED[0],
            ACCEPTED[1],
            100.0 * FRACTION
        ),
        measured: format!("{accepted} of {}", runs.len()),
        is_met: !runs.is_empty() && accepted as f64 >= FRACTION * runs.len() as f64,
    }
}

/// Writes the section.
pub fn write(report: &mut Report, settings: &TargetErrorSettings, all: &[SceneResults]) {
    report.section("Does `--target-error` end at the error that was asked for?");
    report.paragraph(&format!(
        "True relMSE over the target, by seed, adaptive and filtered with the default denoiser. `<`: the estimate of the first \
         image ended the render, which is judged if its error is above {} times the target. `>`: {} samples per pixel were \
         not enough; such a render is not judged. The others should end between {} and {} times the target.",
        ACCEPTED[1], settings.max_spp, ACCEPTED[0], ACCEPTED[1]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_images_that_miss_the_target_count_and_better_ones_do_not() {
        let run = |ratio, end| TargetRun { target: 0.01, ratio, end };
        let runs = [
            run(0.2, End::FirstImage),
            run(1.0, End::FirstImage),
            run(1.9, End::FirstImage),
            run(0.3, End::LaterImage),
            run(1.2, End::LaterImage),
            run(5.0, End::Samples),
        ];
        let scene = SceneResults { target_runs: runs.to_vec(), ..SceneResults::default() };
        let judged: Vec<f64> = runs_to_judge([&scene]).iter().map(|run| run.ratio).collect();
        assert_eq!(judged, [1.9, 0.3, 1.2]);
        let Goal { measured, is_met, .. } = goal(&[scene]);
        assert_eq!((measured.as_str(), is_met), ("1 of 3", false));
    }
}
