//! How fast both methods are, and how their time grows.

use super::{About, Claim, Test, over, stages, times};
use crate::paper::data::{Measured, PRPF, READING, RPF, STANDARD};
use crate::paper::methods::ALL_PIXELS;
use crate::paper::settings::Settings;

pub fn claims(scenes: &[Measured], settings: &Settings) -> Vec<Claim> {
    let base = settings.base_spp;
    let most = |scene: &Measured| scene.rpf_spp.iter().copied().max().unwrap_or(base);
    let growth = |scene: &Measured, method: &str| {
        scene.at(method, most(scene), "seconds") / scene.at(method, base, "seconds")
    };
    let factor = |scene: &Measured| f64::from(most(scene)) / f64::from(base);
    let largest = settings.spp.iter().copied().max().unwrap_or(base);
    let slow_stages = |failing: &[&Measured]| {
        format!("P-RPF's time there: {}", stages(failing, &format!("{PRPF} {largest}")))
    };
    let mut claims = vec![
        Test {
            claim: "RPF's filter time grows with the sample count (largest count over smallest)",
            paper: "in proportion, or more",
            about: About::All,
            number: &|scene| growth(scene, RPF),
            holds: &|scene| growth(scene, RPF) >= 0.8 * factor(scene),
            shown: &times,
            standard: None,
            why: &|failing| {
                let grown = over(failing, |scene| growth(scene, RPF), &times);
                format!("takes {grown} for {} the samples", over(failing, factor, &times))
            },
            remark: None,
        }
        .on(scenes),
        Test {
            claim: "P-RPF's filter time hardly does",
            paper: "nearly flat",
            about: About::All,
            number: &|scene| growth(scene, PRPF),
            holds: &|scene| growth(scene, PRPF) <= 1.25,
            shown: &times,
            standard: Some(&|scene| growth(scene, STANDARD)),
            why: &slow_stages,
            remark: None,
        }
        .on(scenes),
    ];
    let without_economies = |known: &[&Measured]| {
        let slower = |scene: &Measured| {
            scene.at(RPF, base, "seconds") / scene.get(&format!("{READING} {ALL_PIXELS}"), "seconds")
        };
        let times = over(known, slower, &times);
        format!(
            "P-RPF's statistics come from part of a window's pixels here; from all of them it is {times} faster"
        )
    };
    let by_count = [
        ("P-RPF filters faster than RPF at 8 samples per pixel", "4 to 6 times", 8, 4.0),
        ("… at 16", "4 to 6 times", 16, 4.0),
        ("… at 32", "more than 10 times", 32, 10.0),
        ("… at 64", "about 30 times", 64, 30.0),
    ];
    for (claim, paper, spp, least) in by_count.into_iter().filter(|by| settings.spp.contains(&by.2)) {
        claims.push(
            Test {
                claim,
                paper,
                about: About::All,
                number: &|scene| scene.speed_up(spp),
                // As the paper rounds.
                holds: &|scene| scene.speed_up(spp) >= 0.9 * least,
                shown: &times,
                standard: Some(&|scene| scene.at(RPF, spp, "seconds") / scene.at(STANDARD, spp, "seconds")),
                why: &slow_stages,
                remark: (spp == base).then_some(&without_economies),
            }
            .on(scenes),
        );
    }
    let largest = settings.spp.iter().copied().filter(|&spp| spp <= 32).max().unwrap_or(base);
    let against = |scene: &Measured, method: &str| {
        scene.at(method, largest, "seconds") / scene.at(RPF, base, "seconds")
    };
    claims.push(
        Test {
            claim: "P-RPF at 32 samples takes no longer than RPF at 8 (time over time)",
            paper: "1× or less",
            about: About::All,
            number: &|scene| against(scene, PRPF),
            holds: &|scene| against(scene, PRPF) <= 1.0,
            shown: &times,
            standard: Some(&|scene| against(scene, STANDARD)),
            why: &slow_stages,
            remark: None,
        }
        .on(scenes),
    );
    claims
}
