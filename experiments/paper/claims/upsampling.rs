//! What interpolating the weights gains and costs.

use super::{About, Claim, Test, over, percent, plain, times};
use crate::paper::data::{Measured, PRPF, READING, UPSAMPLING, WHOLE};
use crate::paper::methods::ALL_PIXELS;
use crate::paper::settings::Settings;

pub fn claims(scenes: &[Measured], settings: &Settings) -> Vec<Claim> {
    let (base, most) = (settings.base_spp, settings.spp.iter().copied().max().unwrap_or(settings.base_spp));
    let interpolated = |scene: &Measured| scene.get(WHOLE, "interpolated");
    let faster = |scene: &Measured, what: &str| {
        scene.get(UPSAMPLING, &format!("{what} without")) / scene.get(UPSAMPLING, &format!("{what} with"))
    };
    let cost = |scene: &Measured| scene.get(UPSAMPLING, "mse with") - scene.get(UPSAMPLING, "mse without");
    let bound_by_failures = |failing: &[&Measured]| {
        let direct = over(failing, |scene| 1.0 - scene.get(UPSAMPLING, "interpolated"), &percent);
        format!("weights are computed directly at {direct} of the pixels between nodes")
    };
    let interpolated_elsewhere = |failing: &[&Measured]| {
        let at = |spp| over(failing, |scene| scene.at(PRPF, spp, "interpolated"), &percent);
        let all =
            over(failing, |scene| scene.get(&format!("{READING} {ALL_PIXELS}"), "interpolated"), &percent);
        format!(
            "on the crops {} with {base} samples, {} with {most}, {all} with statistics of all pixels of a window",
            at(base),
            at(most)
        )
    };
    let share_of_weights = |failing: &[&Measured]| {
        let share = |scene: &Measured| {
            scene.get(UPSAMPLING, "weight seconds without") / scene.get(UPSAMPLING, "seconds without")
        };
        format!("without it weights take {} of the time", over(failing, share, &percent))
    };
    let against_mse = |failing: &[&Measured]| {
        let share = |scene: &Measured| cost(scene) / scene.get(UPSAMPLING, "mse without");
        format!("{} of the MSE", over(failing, share, &percent))
    };
    vec![
        Test {
            claim: "Pixels whose weights are interpolated (whole images)",
            paper: "85 to 94 %",
            about: About::All,
            number: &interpolated,
            holds: &|scene| interpolated(scene) >= 0.845,
            shown: &percent,
            standard: None,
            why: &interpolated_elsewhere,
            remark: None,
        }
        .on(scenes),
        Test {
            claim: "Weights are computed faster by upsampling",
            paper: "8 to 10 times",
            about: About::All,
            number: &|scene| faster(scene, "weight seconds"),
            holds: &|scene| faster(scene, "weight seconds") >= 7.5,
            shown: &times,
            standard: None,
            why: &bound_by_failures,
            remark: None,
        }
        .on(scenes),
        Test {
            claim: "The whole filter is faster by it",
            paper: "about 3 times",
            about: About::All,
            number: &|scene| faster(scene, "seconds"),
            holds: &|scene| faster(scene, "seconds") >= 2.5,
            shown: &times,
            standard: None,
            why: &share_of_weights,
            remark: None,
        }
        .on(scenes),
        Test {
            claim: "MSE of interpolated weights",
            paper: "0.001 to 0.002",
            about: About::All,
            number: &|scene| scene.get(UPSAMPLING, "weights mse"),
            holds: &|scene| scene.get(UPSAMPLING, "weights mse") <= 0.0025,
            shown: &plain,
            standard: None,
            why: &bound_by_failures,
            remark: None,
        }
        .on(scenes),
        Test {
            claim: "What upsampling adds to the image's MSE",
            paper: "less than 0.00001",
            about: About::All,
            number: &cost,
            holds: &|scene| cost(scene) < 1e-5,
            shown: &plain,
            standard: None,
            why: &against_mse,
            remark: None,
        }
        .on(scenes),
    ]
}
