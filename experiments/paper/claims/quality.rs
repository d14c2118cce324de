//! How good they are, at equal samples and at equal time.

use super::{About, Claim, Test, over, times};
use crate::paper::data::{EQUAL, Measured, PRPF, READING, RPF, STANDARD, UNFILTERED};
use crate::paper::settings::Settings;

/// The other reading of P-RPF with the least MSE: its name and its MSE.
fn best_reading(scene: &Measured) -> Option<(&str, f64)> {
    let readings = scene.runs.iter().filter_map(|(run, values)| {
        Some((run.strip_prefix(READING)?.trim_start().strip_prefix("P-RPF, ")?, *values.get("mse")?))
    });
    readings.min_by(|a, b| a.1.total_cmp(&b.1))
}

pub fn claims(scenes: &[Measured], settings: &Settings) -> Vec<Claim> {
    let base = settings.base_spp;
    let ratio =
        |scene: &Measured, method: &str, spp: u32| scene.at(method, spp, "mse") / scene.at(RPF, spp, "mse");
    let worst = |scene: &Measured, method: &str| {
        scene.rpf_spp.iter().map(|&spp| ratio(scene, method, spp)).fold(f64::NAN, f64::max)
    };
    let other_readings = |failing: &[&Measured]| {
        let best = |scene: &Measured| {
            best_reading(scene).map_or(f64::NAN, |(_, mse)| mse / scene.at(RPF, base, "mse"))
        };
        let mut names: Vec<&str> =
            failing.iter().filter_map(|scene| best_reading(scene)).map(|(name, _)| name).collect();
        names.sort_unstable();
        names.dedup();
        let mended = failing.iter().all(|scene| best(scene) <= 1.1);
        format!(
            "{}: {} at {base} samples, {} with the best of the other readings ({})",
            if mended { "the reading is the cause" } else { "no reading mends it everywhere" },
            over(failing, |scene| ratio(scene, PRPF, base), &times),
            over(failing, best, &times),
            names.join("; ")
        )
    };
    let equal = |scene: &Measured, method: &str| {
        scene.at(RPF, base, "mse") / scene.get(&format!("{EQUAL} {method}"), "mse")
    };
    let equal_why = |failing: &[&Measured]| {
        let samples =
            over(failing, |scene| scene.get(&format!("{EQUAL} {PRPF}"), "spp"), &|spp| spp.to_string());
        let left = |method: &'static str| {
            let share = move |scene: &Measured| {
                scene.get(&format!("{EQUAL} {method}"), "mse") / scene.at(method, base, "mse")
            };
            over(failing, share, &times)
        };
        format!(
            "P-RPF has the time for {samples} samples, which leave {} of its MSE at {base}; as many unfiltered leave {}",
            left(PRPF),
            left(UNFILTERED)
        )
    };
    let mut claims = vec![
        Test {
            claim: "P-RPF's MSE is within 10 % of RPF's at equal samples (worst count)",
            paper: "0.9× to 1.1×",
            about: About::All,
            number: &|scene| worst(scene, PRPF),
            holds: &|scene| worst(scene, PRPF) <= 1.1,
            shown: &times,
            standard: Some(&|scene| worst(scene, STANDARD)),
            why: &other_readings,
            remark: None,
        }
        .on(scenes),
    ];
    for (claim, paper, scene, least) in [
        ("Equal time, dof-dragons: MSE lower than RPF's at 8 samples", "3×", "dof-dragons", 3.0),
        ("Equal time, San Miguel: likewise", "1.85× (46 % lower)", "sanmiguel-dof", 1.0 / 0.54),
    ] {
        claims.push(
            Test {
                claim,
                paper,
                about: About::One(scene),
                number: &|scene| equal(scene, PRPF),
                holds: &|scene| equal(scene, PRPF) >= 0.9 * least,
                shown: &times,
                standard: Some(&|scene| equal(scene, STANDARD)),
                why: &equal_why,
                remark: None,
            }
            .on(scenes),
        );
    }
    claims
}
