//! Reports how well the loop's error estimates agree with the true error.

use std::collections::BTreeSet;

use super::scene_results::SceneResults;
use crate::configuration::CONFIGURATIONS;
use crate::estimate_check::EstimateCheck;
use crate::report::{Report, median, number, range};

/// Agreement of the estimates with the true error for the images of one scene and sample count.
#[derive(Clone, Copy)]
struct Agreement {
    /// Sum of the estimates over the sum of the true relMSEs.
    ratio: f64,
    /// Mean over the images.
    rank_correlation: f64,
    images: usize,
    /// Images whose true error is within the interval.
    within: usize,
}

/// Whether the true error is within the estimate's interval.
fn is_within_interval(check: &EstimateCheck) -> bool {
    (check.low..=check.high).contains(&check.truth)
}

/// Agreement over the seeds at a sample count; `None` without estimates.
fn agreement(checks: &[EstimateCheck], at: u32) -> Option<Agreement> {
    let chosen: Vec<&EstimateCheck> = checks.iter().filter(|check| check.spp == at).collect();
    let sum = |value: fn(&EstimateCheck) -> f64| chosen.iter().map(|check| value(check)).sum::<f64>();
    (!chosen.is_empty()).then(|| Agreement {
        ratio: sum(|check| check.estimate) / sum(|check| check.truth),
        rank_correlation: sum(|check| check.rank_correlation) / chosen.len() as f64,
        images: chosen.len(),
        within: chosen.iter().filter(|check| is_within_interval(check)).count(),
    })
}

fn counts(all: &[SceneResults]) -> BTreeSet<u32> {
    all.iter().flat_map(|m| m.curves.checks.iter().flatten()).map(|check| check.spp).collect()
}

fn agreements(all: &[SceneResults]) -> Vec<Agreement> {
    let counts = counts(all);
    let by_count = |checks| counts.iter().filter_map(move |&at| agreement(checks, at));
    all.iter().flat_map(|m| &m.curves.checks).flat_map(|checks| by_count(checks)).collect()
}

/// The finding, in a sentence.
pub fn finding(all: &[SceneResults]) -> String {
    let found = agreements(all);
    let ratios = || found.iter().map(|a| a.ratio);
    let checks = || all.iter().flat_map(|m| m.curves.checks.iter().flatten());
    let within = checks().filter(|check| is_within_interval(check)).count() as f64 / checks().count() as f64;
    format!(
        "The program's estimate of an image's relMSE is {} times the true one (median; {} by scene, configuration and \
         sample count). In {:.0} % of the {} images the true error is within the 95 % interval, whose half-width is {} of \
         the estimate (median). Over tiles of \
         16×16 pixels the rank correlation of estimate and true error is {} (median; {}).",
        number(median(ratios()), 2),
        range(ratios(), 2),
        100.0 * within,
        checks().count(),
        number(median(checks().map(|check| 0.5 * (check.high - check.low) / check.estimate)), 2),
        number(median(found.iter().map(|a| a.rank_correlation)), 2),
        range(found.iter().map(|a| a.rank_correlation), 2),
    )
}

/// Writes the section.
pub fn write(report: &mut Report, all: &[SceneResults]) {
    report.section("Do the error estimates agree with the true error?");
    report.paragraph(
        "Ratio of the program's estimate for the final image to that image's true relMSE (both means over the seeds) / \
         Spearman's rank correlation of the two over tiles of 16×16 pixels / images whose true error is within the interval.",
    );
    let counts = counts(all);
    let mut rows = Vec::new();
    for m in all {
        for (configuration, checks) in CONFIGURATIONS.iter().zip(&m.curves.checks).skip(1) {
            let cell = |&at: &u32| {
                let format_cell = |a: Agreement| {
                    let [ratio, rank] = [a.ratio, a.rank_correlation].map(|v| number(v, 2));
                    format!("{ratio} / {rank} / {} of {}", a.within, a.images)
                };
                agreement(checks, at).map_or(String::new(), format_cell)
            };
            let cells = counts.iter().map(cell);
            rows.push([m.scene.clone(), configuration.name().to_owned()].into_iter().chain(cells).collect());
        }
    }
    let counts: Vec<String> = counts.iter().map(|spp| format!("{spp} spp")).collect();
    let head: Vec<&str> =
        ["scene", "configuration"].into_iter().chain(counts.iter().map(String::as_str)).collect();
    report.table(&head, &rows);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_are_compared_by_sums_over_seeds() {
        let check = |spp, estimate, truth, rank_correlation| EstimateCheck {
            spp,
            estimate,
            low: 0.4 * estimate,
            high: 1.6 * estimate,
            truth,
            rank_correlation,
        };
        let checks = [check(8, 0.3, 0.1, 0.5), check(8, 0.1, 0.1, 0.7), check(16, 9.0, 1.0, 0.0)];
        let found = agreement(&checks, 8).unwrap();
        assert!((found.ratio - 2.0).abs() < 1e-12 && (found.rank_correlation - 0.6).abs() < 1e-12);
        assert!(agreement(&checks, 32).is_none());
        assert_eq!((found.images, found.within), (2, 1));
        assert_eq!(checks.map(|check| is_within_interval(&check)), [false, true, false]);
    }
}
