//! Tests the paper's claims against the measurements, and explains failures by other measurements.

mod breakdown;
mod claim;
mod quality;
mod speed;
mod upsampling;

use super::scene_results::{PRPF, SceneResults};
use super::settings::Settings;
use crate::report::{median, number, range};
use crate::statistics::geometric_mean;

pub use claim::Claim;
use claim::format_interval;

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
    let fail = count(&|claim| claim.tested > 0 && claim.holds == 0 && claim.undecided == 0);
    let speed_ups = |spp: u32| range(scenes.iter().map(|scene| scene.speed_up(PRPF, spp).mean), 2);
    let ratios = settings
        .spp
        .iter()
        .flat_map(|&spp| scenes.iter().map(move |scene| scene.mse_over_rpf(PRPF, spp).mean));
    let ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
    let at_base = scenes.iter().map(|scene| scene.mse_over_rpf(PRPF, settings.base_spp).mean);
    let at_base: Vec<f64> = at_base.filter(|ratio| ratio.is_finite()).collect();
    let max_spp = scenes.iter().filter_map(SceneResults::max_rpf_spp).max().unwrap_or(settings.base_spp);
    let with_max = scenes.iter().filter(|scene| scene.max_rpf_spp() == Some(max_spp)).count();
    format!(
        "**Of {measured} claims {hold} hold on every scene and {fail} on none; the others hold on some, or are undecided.** \
         P-RPF filters {} times faster than RPF at {} samples per pixel and {} times at {max_spp} (on {with_max} of {} scenes); \
         its MSE is {} times RPF's at equal samples (median {}), at {} samples {} in the geometric mean of the scenes (interval \
         over scenes).",
        speed_ups(settings.base_spp),
        settings.base_spp,
        speed_ups(max_spp),
        scenes.len(),
        range(ratios.iter().copied(), 2),
        number(median(ratios), 2),
        settings.base_spp,
        format_interval(geometric_mean(&at_base)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ledger::values;
    use crate::paper::scene_results::{BASE_OF_GROWTH, EQUAL_TIME, RPF, TIME_OVER_RPF, at, beside};
    use crate::paper::settings::RpfRuns;

    /// A scene with two seeds. `mse` are RPF's and P-RPF's at the larger count, of each seed; those at the smaller are 1.
    fn scene(
        name: &str,
        from_paper: bool,
        rpf: [f64; 2],
        prpf: [f64; 2],
        mse: [[f64; 2]; 2],
    ) -> SceneResults {
        let rpf_runs = [8, 64].map(|spp| RpfRuns { spp, seeds: 2, side: 40 }).to_vec();
        let mut scene = SceneResults { name: name.into(), from_paper, rpf_runs, runs: Default::default() };
        for (method, [few, many], mse) in [(RPF, rpf, mse[0]), (PRPF, prpf, mse[1])] {
            for (spp, seconds, mse) in [(8, few, [1.0; 2]), (64, many, mse)] {
                for mse in mse {
                    let quantities =
                        [("seconds", seconds), ("mse", mse), ("mse 40", mse), ("brightness 40", 0.9)];
                    scene.add(at(method, spp), values(quantities));
                    if method == RPF && spp == 8 {
                        scene.add(BASE_OF_GROWTH, values([("seconds", seconds)]));
                    } else if method == PRPF {
                        scene.add(beside(method, spp), values(quantities));
                    }
                }
            }
        }
        scene
    }

    fn settings() -> Settings {
        crate::settings::read(&crate::settings::package_folder().join("paper.toml"), false).unwrap()
    }

    #[test]
    fn a_claim_explains_the_scenes_on_which_it_fails() {
        let fast = scene("dof-dragons", true, [5.0, 320.0], [1.0, 1.0], [[1.0, 1.0]; 2]);
        let slow = scene("ajar", false, [5.0, 20.0], [1.0, 2.0], [[1.0, 1.0]; 2]);
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
        assert_eq!(by_name("P-RPF's MSE is at most").explanation, "");
    }

    #[test]
    fn claims_on_errors_are_decided_by_their_intervals() {
        let scenes = [
            scene("pool", false, [1.0, 8.0], [1.0, 1.0], [[0.5, 0.51], [0.2, 0.21]]),
            scene("statues", false, [1.0, 8.0], [1.0, 1.0], [[2.0, 2.02], [0.9, 0.1]]),
        ];
        let all = claims(&scenes, &settings());
        let by_name = |start: &str| all.iter().find(|claim| claim.claim.starts_with(start)).unwrap();
        let rpf = by_name("RPF's MSE falls");
        assert_eq!(rpf.verdict(), "on 1 of 2");
        let expected = "statues: statues 2.0× (1.9 to 2.1); the mean of its images is 90 % of";
        assert!(rpf.explanation.starts_with(expected), "{}", rpf.explanation);
        assert_eq!(by_name("P-RPF's MSE falls").verdict(), "on 1 of 2, undecided on 1");
    }

    #[test]
    fn a_claim_at_equal_time_is_not_decided_by_another_time() {
        let verdict = |time: f64| {
            let mut scene = scene("dof-dragons", true, [1.0, 8.0], [1.0, 1.0], [[1.0, 1.0], [0.2, 0.21]]);
            for mse in [0.1, 0.11] {
                let run = format!("{EQUAL_TIME} {PRPF}");
                scene.add(run, values([("mse", mse), ("spp", 400.0), (TIME_OVER_RPF, time)]));
            }
            let all = claims(&[scene], &settings());
            let claim = all.iter().find(|claim| claim.claim.starts_with("Equal time, dof-dragons")).unwrap();
            assert!(claim.explanation.contains("P-RPF takes 400 samples"), "{}", claim.explanation);
            claim.verdict()
        };
        assert_eq!(verdict(1.05), "holds");
        assert_eq!(verdict(0.8), "on 0 of 1, undecided on 1");
    }

    #[test]
    fn the_finding_counts_the_claims() {
        let scenes = [scene("pool", false, [5.0, 320.0], [1.0, 1.0], [[1.0, 1.0]; 2])];
        let all = claims(&scenes, &settings());
        let finding = finding(&all, &scenes, &settings());
        assert!(finding.contains("5.0 times faster") && finding.contains("320 times at 64"), "{finding}");
    }
}
