//! Whether the error that the program shows is the true one.

use std::collections::BTreeSet;

use super::Measured;
use crate::curves::Checked;
use crate::report::{Report, median, number, range};

/// What the loop said over what is true, of the images of one sample count on one scene.
#[derive(Clone, Copy)]
struct Agreement {
    ratio: f64,
    rank_correlation: f64,
}

/// Both samplings' names, in the order of [`crate::curves::Curves::checks`].
const SAMPLINGS: [&str; 2] = ["uniform", "adaptive"];

fn spp(check: &Checked) -> u32 {
    check.spp.round() as u32
}

/// Whether the truth is where the estimate's own standard error leads to expect it.
fn holds(check: &Checked) -> bool {
    (check.estimate - check.truth).abs() <= 2.0 * check.standard_error
}

/// Sums over the seeds; `None` where nothing was said.
fn agreement(checks: &[Checked], at: u32) -> Option<Agreement> {
    let chosen: Vec<&Checked> = checks.iter().filter(|check| spp(check) == at).collect();
    let sum = |of: fn(&Checked) -> f64| chosen.iter().map(|check| of(check)).sum::<f64>();
    (!chosen.is_empty()).then(|| Agreement {
        ratio: sum(|check| check.estimate) / sum(|check| check.truth),
        rank_correlation: sum(|check| check.rank_correlation) / chosen.len() as f64,
    })
}

fn counts(all: &[Measured]) -> BTreeSet<u32> {
    all.iter().flat_map(|m| m.curves.checks.iter().flatten()).map(spp).collect()
}

fn agreements(all: &[Measured]) -> Vec<Agreement> {
    let counts = counts(all);
    let of = |checks| counts.iter().filter_map(move |&at| agreement(checks, at));
    all.iter().flat_map(|m| &m.curves.checks).flat_map(|checks| of(checks)).collect()
}

/// What it comes to, in a sentence.
pub fn finding(all: &[Measured]) -> String {
    let found = agreements(all);
    let ratios = || found.iter().map(|a| a.ratio);
    let checks = || all.iter().flat_map(|m| m.curves.checks.iter().flatten());
    let within = checks().filter(|check| holds(check)).count() as f64 / checks().count() as f64;
    format!(
        "The relMSE that the program shows is {} times the true one of the image that it speaks of (median; {} by scene, \
         sampling and sample count; in {:.0} % of the images the truth is within two of the standard errors that it gives); by tiles \
         of 16×16 pixels its ranks correlate with the truth by {} (median; {}).",
        number(median(ratios()), 2),
        range(ratios(), 2),
        100.0 * within,
        number(median(found.iter().map(|a| a.rank_correlation)), 2),
        range(found.iter().map(|a| a.rank_correlation), 2),
    )
}

/// Writes the section.
pub fn write(report: &mut Report, all: &[Measured]) {
    report.section("Is the error that the program shows the true one?");
    report.paragraph(
        "The estimate that the loop made of an image, from the samples after it, over that image's true relMSE (both mean \
         of the seeds), and Spearman's correlation of both over tiles of 16×16 pixels. Columns: samples per pixel of the \
         image. The one before the last batch is filtered like the final image, those before it with `draft`.",
    );
    let counts = counts(all);
    let mut rows = Vec::new();
    for m in all {
        for (sampling, checks) in SAMPLINGS.iter().zip(&m.curves.checks) {
            let cell = |&at: &u32| {
                let shown =
                    |a: Agreement| format!("{} / {}", number(a.ratio, 2), number(a.rank_correlation, 2));
                agreement(checks, at).map_or(String::new(), shown)
            };
            let cells = counts.iter().map(cell);
            rows.push([m.scene.clone(), (*sampling).to_owned()].into_iter().chain(cells).collect());
        }
    }
    let counts: Vec<String> = counts.iter().map(|spp| format!("{spp} spp")).collect();
    let head: Vec<&str> =
        ["scene", "sampling"].into_iter().chain(counts.iter().map(String::as_str)).collect();
    report.table(&head, &rows);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_are_compared_by_sums_over_seeds() {
        let check = |spp, estimate, truth, rank_correlation| Checked {
            spp,
            estimate,
            standard_error: 0.1,
            truth,
            rank_correlation,
        };
        let checks = [check(8.01, 0.3, 0.1, 0.5), check(8.0, 0.1, 0.1, 0.7), check(16.0, 9.0, 1.0, 0.0)];
        let found = agreement(&checks, 8).unwrap();
        assert!((found.ratio - 2.0).abs() < 1e-12 && (found.rank_correlation - 0.6).abs() < 1e-12);
        assert!(agreement(&checks, 32).is_none());
        assert_eq!(checks.map(|check| holds(&check)), [true, true, false]);
    }
}
