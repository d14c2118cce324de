//! Claims on the time of each stage, and on the samples that a selection by pixels lets in.

use prpf::filter::PrpfSettings;

use super::claim::{
    Claim, ClaimTest, Explain, SUFFICIENT_FRACTION, Scope, format_percent, format_range, stage_fractions,
};
use crate::paper::interpretations::{ALL_PIXELS, RELEASE};
use crate::paper::scene_results::{INTERPRETATION, OUTSIDE, PRPF, RPF, SceneResults};
use crate::paper::settings::Settings;
use crate::paper::stage_timer::STAGES;
use crate::report::{median, number};

/// Fractions of P-RPF's time that the paper gives for its stages.
const PRPF_FRACTIONS: [f64; 3] = [0.6, 0.3, 0.1];
/// Those of RPF.
const RPF_FRACTIONS: [f64; 3] = [0.2, 0.4, 0.4];

/// All claims on stages and on the selection of samples.
pub fn claims(scenes: &[SceneResults], settings: &Settings) -> Vec<Claim> {
    let base = settings.base_spp;
    let explain_rpf = |failing: &[&SceneResults]| {
        let release = stage_fractions(failing, &format!("{INTERPRETATION} {RELEASE}"));
        let own = stage_fractions(failing, &format!("{RPF} {base}"));
        format!("{own}; with the settings of the authors' code: {release}")
    };
    vec![
        samples_outside(scenes),
        stages(
            ("P-RPF's time in neighbourhoods : weights : filter", "6 : 3 : 1", PRPF),
            PRPF_FRACTIONS,
            &explain_prpf_stages,
            scenes,
            base,
        ),
        stages(("RPF's likewise", "2 : 4 : 4", RPF), RPF_FRACTIONS, &explain_rpf, scenes, base),
    ]
}

/// Whether all fractions are as expected, to the tenth that the paper gives.
fn are_similar(fraction: &dyn Fn(usize) -> f64, expected: [f64; 3]) -> bool {
    (0..3).all(|k| (fraction(k) - expected[k]).abs() <= 0.1)
}

fn explain_prpf_stages(failing: &[&SceneResults]) -> String {
    let side = PrpfSettings::paper().statistics_side;
    let run = format!("{INTERPRETATION} {ALL_PIXELS}");
    let holds = |scene: &&&SceneResults| are_similar(&|k| scene.get(&run, STAGES[k]), PRPF_FRACTIONS);
    format!(
        "statistics come from {side}×{side} pixels of a window here; from all of them it holds on {} of these {}: {}",
        failing.iter().filter(holds).count(),
        failing.len(),
        stage_fractions(failing, &run)
    )
}

fn samples_outside(scenes: &[SceneResults]) -> Claim {
    let outside = |scene: &SceneResults| {
        let seeds = scene.runs.get(OUTSIDE).into_iter().flatten();
        let fractions = seeds.flat_map(|values| values.values().copied());
        let fractions: Vec<f64> = fractions.collect();
        fractions.iter().sum::<f64>() / fractions.len() as f64
    };
    let windows = PrpfSettings::paper().windows;
    let largest = windows.iter().copied().max().unwrap_or(0);
    let smallest = windows.iter().copied().min().unwrap_or(0);
    ClaimTest {
        claim: "Samples beyond the similarity threshold in a selection by pixels (mean of the windows)",
        paper: "5 to 10 %",
        scope: Scope::All,
        value: &outside,
        holds: &|scene| Some(outside(scene) <= 0.1 / SUFFICIENT_FRACTION),
        format: &format_percent,
        nlm: None,
        explain: &|failing| {
            let fraction = |window: usize| {
                let quantity = format!("window {window}");
                format_range(failing, |scene| scene.get(OUTSIDE, &quantity), &format_percent)
            };
            format!("{} in the largest window, {} in the smallest", fraction(largest), fraction(smallest))
        },
        remark: None,
    }
    .evaluate(scenes)
}

/// A claim on the fractions of a method's time in its stages.
fn stages(
    (claim, paper, method): (&'static str, &'static str, &'static str),
    expected: [f64; 3],
    explain: Explain,
    scenes: &[SceneResults],
    base: u32,
) -> Claim {
    let fraction = |scene: &SceneResults, k: usize| scene.at(method, base, STAGES[k]);
    let mut claim = ClaimTest {
        claim,
        paper,
        scope: Scope::All,
        value: &|scene| fraction(scene, 0),
        holds: &|scene| Some(are_similar(&|k| fraction(scene, k), expected)),
        format: &format_percent,
        nlm: None,
        explain,
        remark: None,
    }
    .evaluate(scenes);

    // Show all stages, not the first alone
    for (i, from_paper) in [true, false].into_iter().enumerate() {
        let group = || scenes.iter().filter(move |scene| scene.from_paper == from_paper);
        let tenths = |k| 10.0 * median(group().map(|scene| fraction(scene, k)));
        claim.ours[i] = [0, 1, 2].map(|k| number(tenths(k), 2)).join(" : ");
    }
    claim
}
