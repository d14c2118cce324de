//! Reports how well the loop's error estimates agree with the true error.

use std::collections::BTreeSet;

use super::scene_results::SceneResults;
use crate::configuration::CONFIGURATIONS;
use crate::estimate_check::EstimateCheck;
use crate::report::{Goal, Report, median, number, range};
use crate::test_scene::groups;

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

/// Removes checks that equal an earlier one: adaptive sampling that chose uniform sampling made the same image.
fn keep_once(checks: &mut [Vec<EstimateCheck>]) {
    let mut found: Vec<EstimateCheck> = Vec::new();
    for checks in checks {
        checks.retain(|check| !found.contains(check));
        found.extend(&*checks);
    }
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

/// Agreement of the estimates with the true error over several scenes and sample counts.
struct Summary {
    images: usize,
    /// Fraction of the images whose true error is within the interval.
    within: f64,
    /// Half-widths of the intervals over the estimates: median.
    half_width: f64,
    /// Estimate over truth by scene, configuration and sample count.
    ratios: Vec<f64>,
    /// Likewise.
    rank_correlations: Vec<f64>,
}

impl Summary {
    /// `None` without estimates.
    fn new(scenes: &[&SceneResults], filtered: bool) -> Option<Self> {
        let configurations = |m: &&SceneResults| {
            let pairs = CONFIGURATIONS.iter().zip(&m.curves.checks);
            let chosen = pairs.filter(|(configuration, _)| configuration.filtered == filtered);
            let mut checks: Vec<_> = chosen.map(|(_, checks)| checks.clone()).collect();
            keep_once(&mut checks);
            checks
        };
        let checks: Vec<Vec<EstimateCheck>> = scenes.iter().flat_map(configurations).collect();
        let counts: BTreeSet<u32> = checks.iter().flatten().map(|check| check.spp).collect();
        let by_count = |checks| counts.iter().filter_map(move |&at| agreement(checks, at));
        let found: Vec<Agreement> = checks.iter().flat_map(|checks| by_count(checks)).collect();
        let images = checks.iter().flatten().count();
        let within = checks.iter().flatten().filter(|check| is_within_interval(check)).count();
        let half_widths =
            checks.iter().flatten().map(|check| 0.5 * (check.high - check.low) / check.estimate);
        (images > 0).then(|| Self {
            images,
            within: within as f64 / images as f64,
            half_width: median(half_widths),
            ratios: found.iter().map(|a| a.ratio).collect(),
            rank_correlations: found.iter().map(|a| a.rank_correlation).collect(),
        })
    }
}

/// Summaries of filtered and unfiltered images of our scenes and of public ones, with what they are of.
fn summaries(all: &[SceneResults]) -> Vec<(String, Summary)> {
    let of_group = |(name, scenes): (&str, Vec<&SceneResults>)| {
        [(true, "filtered"), (false, "unfiltered")].map(|(filtered, images)| {
            let of = format!("{images}, {name} ({})", scenes.len());
            Summary::new(&scenes, filtered).map(|summary| (of, summary))
        })
    };
    groups(all, |m| m.is_public).into_iter().flat_map(of_group).flatten().collect()
}

/// The finding, in a sentence.
pub fn finding(all: &[SceneResults]) -> String {
    let of_images = |(of, summary): (String, Summary)| {
        format!(
            "{of}: {} in the median ({}), the true error within the 95 % interval in {:.0} % of {} images, half its width {} of the estimate",
            number(median(summary.ratios.iter().copied()), 2),
            range(summary.ratios.iter().copied(), 2),
            100.0 * summary.within,
            summary.images,
            number(summary.half_width, 2),
        )
    };
    let parts: Vec<String> = summaries(all).into_iter().map(of_images).collect();
    format!("The program's estimate of an image's relMSE over the true one: {}.", parts.join("; "))
}

/// The goals, beside what was measured.
pub fn goals(all: &[SceneResults]) -> Vec<Goal> {
    const WITHIN: f64 = 0.9;
    const HALF_WIDTH: f64 = 0.5;
    const RANK_CORRELATION: f64 = 0.7;
    let summaries: Vec<Summary> = summaries(all).into_iter().map(|(_, summary)| summary).collect();
    let goal = |goal: String, value: fn(&Summary) -> f64, is_met: &dyn Fn(f64) -> bool| {
        let values: Vec<f64> = summaries.iter().map(value).collect();
        let measured: Vec<String> = values.iter().map(|&value| number(value, 2)).collect();
        Goal { goal, measured: measured.join(", "), is_met: values.iter().all(|&value| is_met(value)) }
    };
    vec![
        goal(
            format!("true error within the interval in {WITHIN} of the images, by kind of images as below"),
            |summary| summary.within,
            &|within| within >= WITHIN,
        ),
        goal(
            format!("half the interval's width at most {HALF_WIDTH} of the estimate, median"),
            |summary| summary.half_width,
            &|half_width| half_width <= HALF_WIDTH,
        ),
        goal(
            format!("rank correlation of tiles at least {RANK_CORRELATION}, median"),
            |summary| median(summary.rank_correlations.iter().copied()),
            &|correlation| correlation >= RANK_CORRELATION,
        ),
    ]
}

/// Writes the section.
pub fn write(report: &mut Report, all: &[SceneResults]) {
    report.section("Do the error estimates agree with the true error?");
    let row = |(of, summary): (String, Summary)| {
        vec![
            of,
            summary.images.to_string(),
            format!(
                "{} ({})",
                number(median(summary.ratios.iter().copied()), 2),
                range(summary.ratios.iter().copied(), 2)
            ),
            format!("{:.0} %", 100.0 * summary.within),
            number(summary.half_width, 2),
            number(median(summary.rank_correlations.iter().copied()), 2),
        ]
    };
    let rows: Vec<_> = summaries(all).into_iter().map(row).collect();
    report.table(
        &[
            "images",
            "number",
            "estimate over truth, median and range",
            "truth within the interval",
            "half its width over the estimate, median",
            "rank correlation of tiles, median",
        ],
        &rows,
    );
    report.paragraph(
        "Images that adaptive and uniform sampling have in common count once above. Below: ratio of the program's estimate for the final image to that image's true relMSE (both means over the seeds) / \
         Spearman's rank correlation of the two over tiles of 16×16 pixels / images whose true error is within the interval.",
    );
    let checks = all.iter().flat_map(|m| m.curves.checks.iter().flatten());
    let counts: BTreeSet<u32> = checks.map(|check| check.spp).collect();
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
        let mut twice =
            [vec![check(8, 0.3, 0.1, 0.5)], vec![check(8, 0.3, 0.1, 0.5), check(16, 0.3, 0.1, 0.5)]];
        keep_once(&mut twice);
        assert_eq!(twice.map(|checks| checks.len()), [1, 1]);
        let checks = [check(8, 0.3, 0.1, 0.5), check(8, 0.1, 0.1, 0.7), check(16, 9.0, 1.0, 0.0)];
        let found = agreement(&checks, 8).unwrap();
        assert!((found.ratio - 2.0).abs() < 1e-12 && (found.rank_correlation - 0.6).abs() < 1e-12);
        assert!(agreement(&checks, 32).is_none());
        assert_eq!((found.images, found.within), (2, 1));
        assert_eq!(checks.map(|check| is_within_interval(&check)), [false, true, false]);
    }
}
