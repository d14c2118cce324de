//! Claims on the error of both methods, at equal samples and at equal time.

use super::claim::{Claim, ClaimTest, Scope, format_range, format_times};
use crate::paper::scene_results::{EQUAL_TIME, INTERPRETATION, NLM, PRPF, RPF, SceneResults, UNFILTERED};
use crate::paper::settings::Settings;

/// All claims on quality.
pub fn claims(scenes: &[SceneResults], settings: &Settings) -> Vec<Claim> {
    vec![
        at_equal_samples(scenes, settings),
        at_equal_time(
            ("Equal time, dof-dragons: MSE lower than RPF's at 8 samples", "3×"),
            ("dof-dragons", 3.0),
            scenes,
            settings,
        ),
        at_equal_time(
            ("Equal time, San Miguel: likewise", "1.85× (46 % lower)"),
            ("sanmiguel-dof", 1.0 / 0.54),
            scenes,
            settings,
        ),
    ]
}

/// The interpretation of P-RPF with the smallest MSE: its name and its MSE.
fn best_interpretation(scene: &SceneResults) -> Option<(&str, f64)> {
    let interpretations = scene.runs.iter().filter_map(|(run, values)| {
        let name = run.strip_prefix(INTERPRETATION)?.trim_start().strip_prefix("P-RPF, ")?;
        Some((name, *values.get("mse")?))
    });
    interpretations.min_by(|a, b| a.1.total_cmp(&b.1))
}

fn at_equal_samples(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let ratio = |scene: &SceneResults, method: &str, spp: u32| {
        scene.at(method, spp, "mse") / scene.at(RPF, spp, "mse")
    };
    let worst_ratio = |scene: &SceneResults, method: &str| {
        scene.rpf_spp.iter().map(|&spp| ratio(scene, method, spp)).fold(f64::NAN, f64::max)
    };
    let compare_interpretations = |failing: &[&SceneResults]| {
        let best_ratio = |scene: &SceneResults| {
            best_interpretation(scene).map_or(f64::NAN, |(_, mse)| mse / scene.at(RPF, base, "mse"))
        };
        let mut names: Vec<&str> =
            failing.iter().filter_map(|scene| best_interpretation(scene)).map(|(name, _)| name).collect();
        names.sort_unstable();
        names.dedup();
        let holds = failing.iter().all(|scene| best_ratio(scene) <= 1.1);
        format!(
            "{}: {} at {base} samples, {} with the best other interpretation ({})",
            if holds { "the interpretation is the cause" } else { "no interpretation holds everywhere" },
            format_range(failing, |scene| ratio(scene, PRPF, base), &format_times),
            format_range(failing, best_ratio, &format_times),
            names.join("; ")
        )
    };
    ClaimTest {
        claim: "P-RPF's MSE is within 10 % of RPF's at equal samples (worst count)",
        paper: "0.9× to 1.1×",
        scope: Scope::All,
        value: &|scene| worst_ratio(scene, PRPF),
        holds: &|scene| worst_ratio(scene, PRPF) <= 1.1,
        format: &format_times,
        nlm: Some(&|scene| worst_ratio(scene, NLM)),
        explain: &compare_interpretations,
        remark: None,
    }
    .evaluate(scenes)
}

/// A claim on one scene: RPF's MSE over P-RPF's in the time of RPF.
fn at_equal_time(
    (claim, paper): (&'static str, &'static str),
    (name, expected): (&'static str, f64),
    scenes: &[SceneResults],
    settings: &Settings,
) -> Claim {
    let base = settings.base_spp;
    let ratio = |scene: &SceneResults, method: &str| {
        scene.at(RPF, base, "mse") / scene.get(&format!("{EQUAL_TIME} {method}"), "mse")
    };
    let explain = |failing: &[&SceneResults]| {
        let run = format!("{EQUAL_TIME} {PRPF}");
        let samples = format_range(failing, |scene| scene.get(&run, "spp"), &|spp| spp.to_string());
        let remaining = |method: &'static str| {
            let fraction = move |scene: &SceneResults| {
                scene.get(&format!("{EQUAL_TIME} {method}"), "mse") / scene.at(method, base, "mse")
            };
            format_range(failing, fraction, &format_times)
        };
        format!(
            "P-RPF has the time for {samples} samples, which change its MSE to {} of that at {base}; unfiltered, as many \
             change it to {}",
            remaining(PRPF),
            remaining(UNFILTERED)
        )
    };
    ClaimTest {
        claim,
        paper,
        scope: Scope::One(name),
        value: &|scene| ratio(scene, PRPF),
        holds: &|scene| ratio(scene, PRPF) >= 0.9 * expected,
        format: &format_times,
        nlm: Some(&|scene| ratio(scene, NLM)),
        explain: &explain,
        remark: None,
    }
    .evaluate(scenes)
}
