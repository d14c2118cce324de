//! Reports what each priority map contributes: the error without it, and with it alone.

use super::ablation::{ALL_MAPS, Ablation, NONE_OF_THEM, PriorityMaps, names};
use super::report::format_interval;
use crate::curves::{EqualCost, Point, ratios};
use crate::report::Report;
use crate::statistics::{Interval, geometric_mean};

/// A map whose ratio of errors lies between this factor and its inverse has a negligible effect.
const NEGLIGIBLE: f64 = 1.05;

/// The errors of all selections of maps on a scene, beside those of uniform sampling.
pub struct AblatedScene<'a> {
    pub scene: &'a str,
    pub uniform: &'a [Point],
    pub ablations: &'a [(Ablation, Vec<Point>)],
}

impl AblatedScene<'_> {
    /// Ratios of the errors of a selection and of uniform sampling, by seed.
    pub fn ratios(&self, name: &str, equal: EqualCost) -> Vec<f64> {
        let found = self.ablations.iter().find(|(ablation, _)| ablation.name == name);
        found.map_or(Vec::new(), |(_, points)| ratios(points, self.uniform, equal, |p| p.error))
    }

    fn mean_ratio(&self, name: &str, equal: EqualCost) -> f64 {
        geometric_mean(&self.ratios(name, equal)).mean
    }
}

/// Ratio of the error of a selection to that with all maps, over the scenes.
fn against_all_maps(scenes: &[AblatedScene], name: &str, equal: EqualCost) -> Interval {
    let of_scene = |scene: &AblatedScene| scene.mean_ratio(name, equal) / scene.mean_ratio(ALL_MAPS, equal);
    geometric_mean(&scenes.iter().map(of_scene).collect::<Vec<_>>())
}

/// Returns a sentence for each map, and one for all of them where other maps stay.
pub fn verdicts(maps: &PriorityMaps, scenes: &[AblatedScene], equal: EqualCost) -> Vec<String> {
    let verdict = |map: &str| {
        let [alone, left_out] = names(map).map(|name| against_all_maps(scenes, &name, equal));
        let verdict = match left_out {
            Interval { low, .. } if low > 1.0 => "reduces the error",
            Interval { high, .. } if high < 1.0 => "increases the error",
            Interval { low, high, .. } if low >= 1.0 / NEGLIGIBLE && high <= NEGLIGIBLE => {
                "changes the error by less than 5 %"
            }
            _ => "has no effect that these scenes show",
        };
        format!(
            "{map}: the error without it is {} times that with all maps, with it alone {} times: the map {verdict}.",
            format_interval(left_out),
            format_interval(alone)
        )
    };
    let mut verdicts: Vec<String> = maps.maps.iter().map(|(map, _)| verdict(map)).collect();
    let neither = against_all_maps(scenes, NONE_OF_THEM, equal);
    if neither.mean.is_finite() {
        verdicts.push(format!(
            "without any of them the error is {} times that with all maps.",
            format_interval(neither)
        ));
    }
    verdicts
}

/// Writes the verdicts at equal costs, and a table of all selections.
pub fn write(report: &mut Report, maps: &PriorityMaps, scenes: &[AblatedScene], costs: &[EqualCost]) {
    for &equal in costs {
        let cost = match equal {
            EqualCost::Samples => "samples",
            EqualCost::Seconds => "seconds",
        };
        report.paragraph(&format!(
            "At equal {cost}, geometric means over {} scenes (95 % interval):\n\n* {}",
            scenes.len(),
            verdicts(maps, scenes, equal).join("\n* ")
        ));
    }

    // Tabulate the ratios by scene
    let mut head: Vec<&str> = std::iter::once("maps").chain(scenes.iter().map(|m| m.scene)).collect();
    head.push("mean");
    if costs.contains(&EqualCost::Seconds) {
        head.push("mean at equal seconds");
    }
    let selections = scenes.first().map_or(&[][..], |m| m.ablations);
    let row = |(selection, _): &(Ablation, Vec<Point>)| {
        let ratio = |m: &AblatedScene, equal| m.mean_ratio(&selection.name, equal);
        let mean = |equal| geometric_mean(&scenes.iter().map(|m| ratio(m, equal)).collect::<Vec<_>>()).mean;
        let means = [EqualCost::Samples, EqualCost::Seconds].map(mean);
        let numbers = scenes.iter().map(|m| ratio(m, EqualCost::Samples)).chain(means);
        let cells = numbers.map(|ratio| format!("{ratio:.2}")).take(head.len() - 1);
        std::iter::once(selection.name.clone()).chain(cells).collect()
    };
    report.paragraph("Ratios to the error of uniform sampling at equal samples:");
    report.table(&head, &selections.iter().map(row).collect::<Vec<_>>());
}
