//! Tests the paper's claims against the measurements, and explains failures by other measurements.

mod breakdown;
mod claim;
mod quality;
mod speed;
mod upsampling;

use super::scene_results::{PRPF, RPF, SceneResults};
use super::settings::Settings;
use crate::report::{median, number, range};

pub use claim::Claim;

/// Tests all claims on the scenes of a run.
pub fn claims(scenes: &[SceneResults], settings: &Settings) -> Vec<Claim> {
    let mut claims = speed::claims(scenes, settings);
    claims.extend(quality::claims(scenes, settings));
    claims.extend(upsampling::claims(scenes, settings));
    claims.extend(breakdown::claims(scenes, settings));
    claims
}

/// The finding: how many claims hold, and the main figures.
pub fn finding(claims: &[Claim], scenes: &[SceneResults], settings: &Settings) -> String {
    let count = |test: &dyn Fn(&Claim) -> bool| claims.iter().filter(|claim| test(claim)).count();
    let measured = count(&|claim| claim.tested > 0);
    let hold = count(&|claim| claim.tested > 0 && claim.holds == claim.tested);
    let fail = count(&|claim| claim.tested > 0 && claim.holds == 0);
    let speed_ups = |spp: u32| range(scenes.iter().map(|scene| scene.speed_up(spp)), 2);
    let ratios = settings.spp.iter().flat_map(|&spp| {
        scenes.iter().map(move |scene| scene.at(PRPF, spp, "mse") / scene.at(RPF, spp, "mse"))
    });
    let ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
    let max_spp =
        scenes.iter().flat_map(|scene| scene.rpf_spp.iter().copied()).max().unwrap_or(settings.base_spp);
    format!(
        "**Of {measured} claims {hold} hold on every scene, {} on some, {fail} on none.** P-RPF filters {} times faster than \
         RPF at {} samples per pixel and {} times at {max_spp}; its MSE is {} times RPF's at equal samples (median {}).",
        measured - hold - fail,
        speed_ups(settings.base_spp),
        settings.base_spp,
        speed_ups(max_spp),
        range(ratios.iter().copied(), 2),
        number(median(ratios), 2),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ledger::values;

    fn scene(name: &str, from_paper: bool, rpf: [f64; 2], prpf: [f64; 2]) -> SceneResults {
        let mut scene =
            SceneResults { name: name.into(), from_paper, rpf_spp: vec![8, 64], runs: Default::default() };
        for (method, [few, many]) in [(RPF, rpf), (PRPF, prpf)] {
            for (spp, seconds) in [(8, few), (64, many)] {
                scene.runs.insert(format!("{method} {spp}"), values([("seconds", seconds), ("mse", 1.0)]));
            }
        }
        scene
    }

    fn settings() -> Settings {
        crate::settings::read(&crate::settings::package_folder().join("paper.toml"), false).unwrap()
    }

    #[test]
    fn a_claim_explains_the_scenes_on_which_it_fails() {
        let fast = scene("dof-dragons", true, [5.0, 320.0], [1.0, 1.0]);
        let slow = scene("ajar", false, [5.0, 20.0], [1.0, 2.0]);
        let all = claims(&[fast, slow], &settings());
        let by_name = |start: &str| all.iter().find(|claim| claim.claim.starts_with(start)).unwrap();
        let growth = by_name("RPF's filter time grows");
        assert_eq!((growth.ours[0].as_str(), growth.ours[1].as_str()), ("64×", "4.0×"));
        assert_eq!((growth.holds, growth.tested, growth.verdict().as_str()), (1, 2, "on 1 of 2"));
        assert!(
            growth.explanation.starts_with("ajar: takes 4.0× the time for 8.0×"),
            "{}",
            growth.explanation
        );
        assert_eq!(by_name("P-RPF filters faster than RPF at 8").verdict(), "holds");
        assert_eq!(by_name("Pixels whose weights").verdict(), "not measured");
        assert_eq!(by_name("P-RPF's MSE").explanation, "");
    }

    #[test]
    fn the_finding_counts_the_claims() {
        let scenes = [scene("pool", false, [5.0, 320.0], [1.0, 1.0])];
        let all = claims(&scenes, &settings());
        let finding = finding(&all, &scenes, &settings());
        assert!(finding.contains("5.0 times faster") && finding.contains("320 times at 64"), "{finding}");
    }
}
