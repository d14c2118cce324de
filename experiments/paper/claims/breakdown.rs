//! Where the time goes, and what choosing neighbours by pixels lets in.

use prpf::filter::PrpfSettings;

use super::{About, Claim, Said, Test, over, percent, stages};
use crate::paper::data::{Measured, OUTSIDE, PRPF, READING, RPF};
use crate::paper::methods::{ALL_PIXELS, RELEASE, STAGES};
use crate::paper::settings::Settings;
use crate::report::{median, number};

/// Shares of P-RPF's stages.
const BY_PIXELS: [f64; 3] = [0.6, 0.3, 0.1];

/// Whether shares are these, to the tenth that the paper gives.
fn is_about(share: &dyn Fn(usize) -> f64, expected: [f64; 3]) -> bool {
    (0..3).all(|k| (share(k) - expected[k]).abs() <= 0.1)
}

pub fn claims(scenes: &[Measured], settings: &Settings) -> Vec<Claim> {
    let base = settings.base_spp;
    let outside = |scene: &Measured| {
        let shares = scene.runs.get(OUTSIDE).into_iter().flat_map(|values| values.values().copied());
        let shares: Vec<f64> = shares.collect();
        shares.iter().sum::<f64>() / shares.len() as f64
    };
    let published = PrpfSettings::paper();
    let largest = published.windows.iter().copied().max().unwrap_or(0);
    let smallest = published.windows.iter().copied().min().unwrap_or(0);
    let by_window = |failing: &[&Measured]| {
        let share =
            |window: usize| over(failing, |scene| scene.get(OUTSIDE, &format!("window {window}")), &percent);
        format!("{} in the largest window, {} in the smallest", share(largest), share(smallest))
    };
    let with_all_pixels = |failing: &[&Measured]| {
        let side = published.statistics_side;
        let run = format!("{READING} {ALL_PIXELS}");
        let mended =
            failing.iter().filter(|scene| is_about(&|k| scene.get(&run, STAGES[k]), BY_PIXELS)).count();
        let all = stages(failing, &run);
        format!(
            "statistics come from {side}×{side} pixels of a window here; from all of them it holds on {mended} of \
             these {}: {all}",
            failing.len()
        )
    };
    let rpf_stages = |failing: &[&Measured]| {
        let release = stages(failing, &format!("{READING} {RELEASE}"));
        format!(
            "{}; with the settings of the authors' code: {release}",
            stages(failing, &format!("{RPF} {base}"))
        )
    };
    let by_pixels = Test {
        claim: "Samples outside the tolerance when chosen by pixels (mean of the windows)",
        paper: "5 to 10 %",
        about: About::All,
        number: &outside,
        holds: &|scene| outside(scene) <= 0.105,
        shown: &percent,
        standard: None,
        why: &by_window,
        remark: None,
    };
    let mut claims = vec![by_pixels.on(scenes)];
    let rows: [(&str, &str, &str, [f64; 3], Said); 2] = [
        ("P-RPF's time in neighbourhoods : weights : filter", "6 : 3 : 1", PRPF, BY_PIXELS, &with_all_pixels),
        ("RPF's likewise", "2 : 4 : 4", RPF, [0.2, 0.4, 0.4], &rpf_stages),
    ];
    for (claim, paper, method, expected, why) in rows {
        let share = |scene: &Measured, k: usize| scene.at(method, base, STAGES[k]);
        let mut of_all = Test {
            claim,
            paper,
            about: About::All,
            number: &|scene| share(scene, 0),
            holds: &|scene| is_about(&|k| share(scene, k), expected),
            shown: &percent,
            standard: None,
            why,
            remark: None,
        }
        .on(scenes);
        for (place, of_paper) in [true, false].into_iter().enumerate() {
            let group = || scenes.iter().filter(move |scene| scene.of_paper == of_paper);
            let middle = |k| 10.0 * median(group().map(|scene| share(scene, k)));
            of_all.ours[place] = [0, 1, 2].map(|k| number(middle(k), 2)).join(" : ");
        }
        claims.push(of_all);
    }
    claims
}
