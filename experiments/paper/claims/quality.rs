//! Claims on the error of both methods: as samples grow, at equal samples and at equal time.

use super::claim::{
    Claim, ClaimTest, SUFFICIENT_FRACTION, Scope, format_interval, format_percent, format_range,
    format_times, is_at_least, is_at_most,
};
use crate::paper::interpretations::LETTER_OF_REPORT;
use crate::paper::scene_results::{
    EQUAL_TIME, INTERPRETATION, LETTER, NLM, PRPF, RPF, SceneResults, TIME_OVER_RPF, UNFILTERED, at, beside,
    brightness_of_side, mse_of_side,
};
use crate::paper::settings::Settings;
use crate::statistics::Interval;

/// All claims on quality.
pub fn claims(scenes: &[SceneResults], settings: &Settings) -> Vec<Claim> {
    vec![
        rpf_falls(scenes, settings),
        prpf_falls(scenes, settings),
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

/// Lists the interval of each scene by name.
fn list_intervals(scenes: &[&SceneResults], interval: &dyn Fn(&SceneResults) -> Interval) -> String {
    let entries = scenes.iter().map(|scene| format!("{} {}", scene.name, format_interval(interval(scene))));
    entries.collect::<Vec<_>>().join(", ")
}

fn rpf_falls(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let largest = |scene: &SceneResults| scene.max_rpf_spp().unwrap_or(base);
    let ratio = |scene: &SceneResults, method: &str| {
        let shared = mse_of_side(scene.shared_rpf_side());
        scene.ratio(&at(method, largest(scene)), &at(method, base), &shared)
    };
    let brightness =
        |scene: &SceneResults, spp: u32| scene.at(RPF, spp, &brightness_of_side(scene.shared_rpf_side()));
    let brightnesses = |scenes: &[&SceneResults]| {
        let range = |value: &dyn Fn(&SceneResults) -> f64| format_range(scenes, value, &format_percent);
        format!(
            "the mean of its images is {} of the reference's at {base} samples and {} at the largest count",
            range(&|scene| brightness(scene, base)),
            range(&|scene| brightness(scene, largest(scene)))
        )
    };
    ClaimTest {
        claim: "RPF's MSE falls with samples (largest count over smallest, same pixels)",
        paper: "falls",
        scope: Scope::All,
        value: &|scene| ratio(scene, RPF).mean,
        holds: &|scene| is_at_most(ratio(scene, RPF), 1.0),
        format: &format_times,
        nlm: Some(&|scene| ratio(scene, NLM).mean),
        explain: &|failing| {
            format!(
                "{}; {}; {}",
                list_intervals(failing, &|scene| ratio(scene, RPF)),
                brightnesses(failing),
                to_the_letter(failing, settings)
            )
        },
        remark: Some(&|known| to_the_letter(known, settings)),
    }
    .evaluate(scenes)
}

/// States what RPF to the letter of its report does between its first two sample counts.
fn to_the_letter(scenes: &[&SceneResults], settings: &Settings) -> String {
    let base_run = format!("{INTERPRETATION} {LETTER_OF_REPORT}");
    let second = |scene: &SceneResults| scene.rpf_runs.get(1).map_or(0, |runs| runs.spp);
    let ratio = |scene: &SceneResults| {
        let spp = second(scene);
        scene.ratio(&at(LETTER, spp), &base_run, &scene.rpf_mse(spp)).mean
    };
    let brightness = |scene: &SceneResults, run: &str| {
        let side = scene.rpf_runs.get(1).map_or(0, |runs| runs.side);
        scene.get(run, &brightness_of_side(side))
    };
    let known: Vec<&SceneResults> = scenes.iter().copied().filter(|scene| ratio(scene).is_finite()).collect();
    if known.is_empty() {
        return String::new();
    }
    let rising = known.iter().filter(|scene| ratio(scene) > 1.0).count();
    format!(
        "to the letter of its report, which loses the energy of fireflies, its MSE at the second count is {} that at \
         {} (seeds: {}), rises on {rising} of {} scenes, and the mean of its images is {} of the reference's, then {}",
        format_range(&known, ratio, &format_times),
        settings.base_spp,
        settings.rpf_interpretation_seeds,
        known.len(),
        format_range(&known, |scene| brightness(scene, &base_run), &format_percent),
        format_range(&known, |scene| brightness(scene, &at(LETTER, second(scene))), &format_percent)
    )
}

fn prpf_falls(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let largest = settings.spp.iter().copied().max().unwrap_or(base);
    let ratio =
        |scene: &SceneResults, method: &str| scene.ratio(&at(method, largest), &at(method, base), "mse");
    ClaimTest {
        claim: "P-RPF's MSE falls with samples (likewise, whole crop)",
        paper: "falls",
        scope: Scope::All,
        value: &|scene| ratio(scene, PRPF).mean,
        holds: &|scene| is_at_most(ratio(scene, PRPF), 1.0),
        format: &format_times,
        nlm: Some(&|scene| ratio(scene, NLM).mean),
        explain: &|failing| {
            format!(
                "{}; unfiltered {}",
                list_intervals(failing, &|scene| ratio(scene, PRPF)),
                format_range(failing, |scene| ratio(scene, UNFILTERED).mean, &format_times)
            )
        },
        remark: None,
    }
    .evaluate(scenes)
}

/// The other interpretations of P-RPF: their names, and their MSE over that of RPF at the base count on RPF's pixels.
fn interpretations(scene: &SceneResults, base: u32) -> Vec<(&str, f64)> {
    // Over P-RPF on the crop, with the same seeds
    let over_prpf = |run: &str| scene.ratio(run, &at(PRPF, base), &scene.rpf_mse(base)).mean;
    let over_rpf = |run: &str| over_prpf(run) * scene.mse_over_rpf(PRPF, base).mean;
    let interpretations = scene.runs.keys().filter_map(|run| {
        let name = run.strip_prefix(INTERPRETATION)?.trim_start().strip_prefix("P-RPF, ")?;
        Some((name, over_rpf(run)))
    });
    interpretations.filter(|(_, ratio)| ratio.is_finite()).collect()
}

/// Whether a claim holds at each sample count: not if it fails at one, and undecided if it is at one.
fn holds_at_each(ratios: impl Iterator<Item = Interval>, limit: f64) -> Option<bool> {
    let verdicts: Vec<Option<bool>> = ratios.map(|ratio| is_at_most(ratio, limit)).collect();
    if verdicts.contains(&Some(false)) {
        return Some(false);
    }
    verdicts.into_iter().collect::<Option<Vec<bool>>>().map(|_| true)
}

fn at_equal_samples(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let worst = |scene: &SceneResults, method: &str| {
        let ratios = scene.rpf_runs.iter().map(|runs| scene.mse_over_rpf(method, runs.spp));
        let unknown = Interval { mean: f64::NAN, low: f64::NAN, high: f64::NAN };
        ratios
            .filter(|ratio| ratio.mean.is_finite())
            .max_by(|a, b| a.mean.total_cmp(&b.mean))
            .unwrap_or(unknown)
    };
    // The count that fails most clearly
    let failing_count = |scene: &SceneResults| {
        let ratios = scene.rpf_runs.iter().map(|runs| scene.mse_over_rpf(PRPF, runs.spp));
        ratios.max_by(|a, b| a.low.total_cmp(&b.low)).unwrap_or_else(|| worst(scene, PRPF))
    };
    let compare_interpretations = |failing: &[&SceneResults]| {
        let least = |scene: &SceneResults| {
            interpretations(scene, base).into_iter().map(|(_, ratio)| ratio).fold(f64::NAN, f64::min)
        };
        let mut names: Vec<&str> = failing
            .iter()
            .filter_map(|scene| interpretations(scene, base).into_iter().min_by(|a, b| a.1.total_cmp(&b.1)))
            .map(|(name, _)| name)
            .collect();
        names.sort_unstable();
        names.dedup();
        format!(
            "{}; {} at {base} samples, {} with the least of {} other interpretations, chosen by these same runs ({})",
            list_intervals(failing, &failing_count),
            format_range(failing, |scene| scene.mse_over_rpf(PRPF, base).mean, &format_times),
            format_range(failing, least, &format_times),
            failing.iter().map(|scene| interpretations(scene, base).len()).max().unwrap_or(0),
            names.join("; ")
        )
    };
    ClaimTest {
        claim: "P-RPF's MSE is at most 10 % above RPF's at equal samples (worst count)",
        paper: "0.9× to 1.1×",
        scope: Scope::All,
        value: &|scene| worst(scene, PRPF).mean,
        holds: &|scene| {
            holds_at_each(scene.rpf_runs.iter().map(|runs| scene.mse_over_rpf(PRPF, runs.spp)), 1.1)
        },
        format: &format_times,
        nlm: Some(&|scene| worst(scene, NLM).mean),
        explain: &compare_interpretations,
        remark: None,
    }
    .evaluate(scenes)
}

/// Whether a run had about the time of RPF.
fn is_equal_time(time_over_rpf: f64) -> bool {
    (0.9..=1.1).contains(&time_over_rpf)
}

/// A claim on one scene: RPF's MSE over P-RPF's in the time of RPF; undecided if that time was missed.
fn at_equal_time(
    (claim, paper): (&'static str, &'static str),
    (name, expected): (&'static str, f64),
    scenes: &[SceneResults],
    settings: &Settings,
) -> Claim {
    let base = settings.base_spp;
    let run = |method: &str| format!("{EQUAL_TIME} {method}");
    // RPF's MSE over that of the method
    let ratio = |scene: &SceneResults, method: &str| scene.ratio(&at(RPF, base), &run(method), "mse");
    let time = |scene: &SceneResults| scene.get(&run(PRPF), TIME_OVER_RPF);
    let explain = |failing: &[&SceneResults]| {
        let samples = format_range(failing, |scene| scene.get(&run(PRPF), "spp"), &|spp| spp.to_string());
        let remaining = |scene: &SceneResults| scene.ratio(&run(PRPF), &beside(PRPF, base), "mse").mean;
        format!(
            "{}; in {} RPF's time P-RPF takes {samples} samples, which change its MSE to {} of that at {base}; the \
             unfiltered image in that time: {}",
            list_intervals(failing, &|scene| ratio(scene, PRPF)),
            format_range(failing, time, &format_times),
            format_range(failing, remaining, &format_times),
            format_range(failing, |scene| ratio(scene, UNFILTERED).mean, &format_times)
        )
    };
    let is_lower = |scene: &SceneResults| {
        let holds = is_at_least(ratio(scene, PRPF), SUFFICIENT_FRACTION * expected);
        holds.filter(|_| is_equal_time(time(scene)))
    };
    ClaimTest {
        claim,
        paper,
        scope: Scope::One(name),
        value: &|scene| ratio(scene, PRPF).mean,
        holds: &is_lower,
        format: &format_times,
        nlm: Some(&|scene| ratio(scene, NLM).mean),
        explain: &explain,
        remark: Some(&explain),
    }
    .evaluate(scenes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_on_each_count_holds_if_all_decide_for_it() {
        let of = |highs: &[f64]| {
            let intervals = highs.iter().map(|&high| Interval { mean: high - 0.1, low: high - 0.2, high });
            holds_at_each(intervals, 1.1)
        };
        assert_eq!(of(&[1.0, 1.1]), Some(true));
        assert_eq!(of(&[1.0, 1.2]), None);
        // The one with the larger mean is undecided, and another fails
        assert_eq!(of(&[1.2, 1.4, 1.0]), Some(false));
    }
}
