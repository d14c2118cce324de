//! Claims on what the interpolation of feature weights gains and costs.

use super::claim::{
    Claim, ClaimTest, SUFFICIENT_FRACTION, Scope, format_number, format_percent, format_range, format_times,
    is_at_most,
};
use crate::paper::interpretations::ALL_PIXELS;
use crate::paper::scene_results::{INTERPRETATION, PRPF, SceneResults, UPSAMPLING, WHOLE};
use crate::paper::settings::Settings;

/// All claims on upsampling.
pub fn claims(scenes: &[SceneResults], settings: &Settings) -> Vec<Claim> {
    vec![
        interpolated_pixels(scenes, settings),
        speed_up_of_weights(scenes),
        speed_up_of_filter(scenes),
        mse_of_weights(scenes),
        added_mse(scenes),
    ]
}

/// Ratio of the times without and with upsampling; `quantity` names the time.
fn speed_up(scene: &SceneResults, quantity: &str) -> f64 {
    scene.get(UPSAMPLING, &format!("{quantity} without")) / scene.get(UPSAMPLING, &format!("{quantity} with"))
}

fn directly_computed(failing: &[&SceneResults]) -> String {
    let fraction = |scene: &SceneResults| 1.0 - scene.get(UPSAMPLING, "interpolated");
    let fractions = format_range(failing, fraction, &format_percent);
    format!("weights are computed directly at {fractions} of the pixels between nodes")
}

fn interpolated_pixels(scenes: &[SceneResults], settings: &Settings) -> Claim {
    let base = settings.base_spp;
    let max_spp = settings.spp.iter().copied().max().unwrap_or(base);
    let interpolated = |scene: &SceneResults| scene.get(WHOLE, "interpolated");
    ClaimTest {
        claim: "Pixels whose weights are interpolated (whole images)",
        paper: "85 to 94 %",
        scope: Scope::All,
        value: &interpolated,
        holds: &|scene| Some(interpolated(scene) >= SUFFICIENT_FRACTION * 0.85),
        format: &format_percent,
        nlm: None,
        explain: &|failing| {
            let at = |spp| format_range(failing, |scene| scene.at(PRPF, spp, "interpolated"), &format_percent);
            let run = format!("{INTERPRETATION} {ALL_PIXELS}");
            let all = format_range(failing, |scene| scene.get(&run, "interpolated"), &format_percent);
            format!(
                "on the crops {} with {base} samples, {} with {max_spp}, {all} with statistics of all pixels of a window",
                at(base),
                at(max_spp)
            )
        },
        remark: None,
    }
    .evaluate(scenes)
}

fn speed_up_of_weights(scenes: &[SceneResults]) -> Claim {
    let speed_up = |scene: &SceneResults| speed_up(scene, "weight seconds");
    ClaimTest {
        claim: "Upsampling speeds up the computation of weights",
        paper: "8 to 10 times",
        scope: Scope::All,
        value: &speed_up,
        holds: &|scene| Some(speed_up(scene) >= SUFFICIENT_FRACTION * 8.0),
        format: &format_times,
        nlm: None,
        explain: &directly_computed,
        remark: None,
    }
    .evaluate(scenes)
}

fn speed_up_of_filter(scenes: &[SceneResults]) -> Claim {
    let speed_up = |scene: &SceneResults| speed_up(scene, "seconds");
    ClaimTest {
        claim: "Upsampling speeds up the whole filter",
        paper: "about 3 times",
        scope: Scope::All,
        value: &speed_up,
        holds: &|scene| Some(speed_up(scene) >= SUFFICIENT_FRACTION * 3.0),
        format: &format_times,
        nlm: None,
        explain: &|failing| {
            let fraction = |scene: &SceneResults| {
                scene.get(UPSAMPLING, "weight seconds without") / scene.get(UPSAMPLING, "seconds without")
            };
            let fractions = format_range(failing, fraction, &format_percent);
            format!("without upsampling, weights take {fractions} of the time")
        },
        remark: None,
    }
    .evaluate(scenes)
}

fn mse_of_weights(scenes: &[SceneResults]) -> Claim {
    let mse = |scene: &SceneResults| scene.get(UPSAMPLING, "weights mse");
    ClaimTest {
        claim: "MSE of interpolated weights",
        paper: "0.001 to 0.002",
        scope: Scope::All,
        value: &mse,
        holds: &|scene| Some(mse(scene) <= 0.002 / SUFFICIENT_FRACTION),
        format: &format_number,
        nlm: None,
        explain: &directly_computed,
        remark: None,
    }
    .evaluate(scenes)
}

fn added_mse(scenes: &[SceneResults]) -> Claim {
    let added = |scene: &SceneResults| scene.get(UPSAMPLING, "added mse");
    ClaimTest {
        claim: "MSE that upsampling adds to the image",
        paper: "less than 0.00001",
        scope: Scope::All,
        value: &added,
        holds: &|scene| is_at_most(scene.interval(UPSAMPLING, "added mse"), 1e-5),
        format: &format_number,
        nlm: None,
        explain: &|failing| {
            let fraction = |scene: &SceneResults| added(scene) / scene.get(UPSAMPLING, "mse without");
            format!("{} of the MSE", format_range(failing, fraction, &format_percent))
        },
        remark: None,
    }
    .evaluate(scenes)
}
