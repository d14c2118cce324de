//! Claims on the speed of both methods, and on its growth with the sample count.

use super::claim::{
    Claim, ClaimTest, SUFFICIENT_FRACTION, Scope, format_range, format_times, is_at_least, is_at_most,
    stage_fractions,
};
use crate::paper::interpretations::ALL_PIXELS;
use crate::paper::scene_results::{BASE_OF_GROWTH, INTERPRETATION, NLM, PRPF, RPF, SceneResults, at};
use crate::paper::settings::Settings;
use crate::statistics::Interval;

/// All claims on speed.
pub fn claims(scenes: &[SceneResults], settings: &Settings) -> Vec<Claim> {
    let mut claims = vec![rpf_growth(scenes, settings), prpf_growth(scenes, settings)];
    claims.extend(speed_ups(scenes, settings));
    if settings.spp.contains(&32) {
        claims.push(prpf_at_32_against_rpf_at_8(scenes, settings));
    }
    claims
}

/// Ratio of a method's filter times on the crop at `spp` and at the base sample count; NaN at the base count itself.
fn growth(scene: &SceneResults, method: &str, spp: u32, base: u32) -> Interval {
    let unknown = Interval { mean: f64::NAN, low: f64::NAN, high: f64::NAN };
    if spp > base { scene.ratio(&at(method, spp), &at(method, base), "seconds") } else { unknown }
}

/// States how P-RPF's time at the largest sample count splits into stages.
fn prpf_stages(failing: &[&SceneResults], settings: &Settings) -> String {
    let max_spp = settings.spp.iter().copied().max().unwrap_or(settings.base_spp);
    format!("P-RPF's time there: {}", stage_fractions(failing, &format!("{PRPF} {max_spp}")))
}

fn rpf_growth(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let max_spp = |scene: &SceneResults| scene.max_rpf_spp().unwrap_or(base);
    let time_ratio = |scene: &SceneResults| scene.ratio(&at(RPF, max_spp(scene)), BASE_OF_GROWTH, "seconds");
    let sample_ratio = |scene: &SceneResults| f64::from(max_spp(scene)) / f64::from(base);
    ClaimTest {
        claim: "RPF's filter time grows with the sample count (largest count over smallest, same pixels)",
        paper: "in proportion, or more",
        scope: Scope::All,
        value: &|scene| time_ratio(scene).mean,
        holds: &|scene| is_at_least(time_ratio(scene), SUFFICIENT_FRACTION * sample_ratio(scene)),
        format: &format_times,
        nlm: None,
        explain: &|failing| {
            let times = format_range(failing, |scene| time_ratio(scene).mean, &format_times);
            let samples = format_range(failing, sample_ratio, &format_times);
            format!("takes {times} the time for {samples} the samples")
        },
        remark: None,
    }
    .evaluate(scenes)
}

fn prpf_growth(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let max_spp = settings.spp.iter().copied().max().unwrap_or(base);
    ClaimTest {
        claim: "P-RPF's filter time hardly grows (likewise, on the crop; to at most 1.25×)",
        paper: "nearly flat",
        scope: Scope::All,
        value: &|scene| growth(scene, PRPF, max_spp, base).mean,
        holds: &|scene| is_at_most(growth(scene, PRPF, max_spp, base), 1.25),
        format: &format_times,
        nlm: Some(&|scene| growth(scene, NLM, max_spp, base).mean),
        explain: &|failing| prpf_stages(failing, settings),
        remark: None,
    }
    .evaluate(scenes)
}

/// Speed-ups of P-RPF over RPF at each sample count that the paper gives.
fn speed_ups(scenes: &[SceneResults], settings: &Settings) -> Vec<Claim> {
    let base = settings.base_spp;
    let with_all_pixels = |known: &[&SceneResults]| {
        // By what statistics of all pixels cost on the crop
        let run = format!("{INTERPRETATION} {ALL_PIXELS}");
        let speed_up = |scene: &SceneResults| {
            scene.speed_up(PRPF, base).mean * scene.ratio(&at(PRPF, base), &run, "seconds").mean
        };
        let times = format_range(known, speed_up, &format_times);
        format!(
            "P-RPF's statistics come from some pixels of a window here; from all of them it is {times} as fast as RPF"
        )
    };
    let claim = |(claim, paper, spp, expected): (&'static str, &'static str, u32, f64)| {
        ClaimTest {
            claim,
            paper,
            scope: Scope::All,
            value: &|scene| scene.speed_up(PRPF, spp).mean,
            holds: &|scene| is_at_least(scene.speed_up(PRPF, spp), SUFFICIENT_FRACTION * expected),
            format: &format_times,
            nlm: Some(&|scene| scene.speed_up(NLM, spp).mean),
            explain: &|failing| prpf_stages(failing, settings),
            remark: (spp == base).then_some(&with_all_pixels),
        }
        .evaluate(scenes)
    };
    [
        ("P-RPF filters faster than RPF at 8 samples per pixel", "4 to 6 times", 8, 4.0),
        ("… at 16", "4 to 6 times", 16, 4.0),
        ("… at 32", "more than 10 times", 32, 10.0),
        ("… at 64", "about 30 times", 64, 30.0),
    ]
    .into_iter()
    .filter(|(_, _, spp, _)| settings.spp.contains(spp))
    .map(claim)
    .collect()
}

fn prpf_at_32_against_rpf_at_8(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let spp = 32;
    // By how the method's time grows on the crop
    let ratio = |scene: &SceneResults, method: &str| {
        growth(scene, method, spp, base).mean / scene.speed_up(method, base).mean
    };
    ClaimTest {
        claim: "P-RPF at 32 samples takes no longer than RPF at 8 (ratio of times)",
        paper: "1× or less",
        scope: Scope::All,
        value: &|scene| ratio(scene, PRPF),
        holds: &|scene| Some(ratio(scene, PRPF) <= 1.0),
        format: &format_times,
        nlm: Some(&|scene| ratio(scene, NLM)),
        explain: &|failing| prpf_stages(failing, settings),
        remark: None,
    }
    .evaluate(scenes)
}
