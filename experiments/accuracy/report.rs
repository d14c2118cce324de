//! The report of `accuracy`: all of its words that say more or less follow from numbers.

use super::front::Front;
use super::{Measured, Settings, agreement, reruns, times};
use crate::bench::Bench;
use crate::report::{Report, number};

pub fn write(bench: &Bench, settings: &Settings, all: &[Measured]) -> anyhow::Result<()> {
    let front = Front::new(settings, all);
    let finding = [times::finding(settings, all), front.finding(), agreement::finding(all)].join("\n\n");
    let mut report = Report::new("What does accuracy cost in time?", &finding);
    times::write(bench, &mut report, settings, all)?;
    front.write(bench, &mut report)?;
    reruns::write(&mut report, &settings.reruns, all);
    agreement::write(&mut report, all);
    report.section("References");
    let references: Vec<String> =
        all.iter().map(|m| format!("{} {}", m.scene, number(m.reference_error, 2))).collect();
    report.paragraph(&format!(
        "Their own relMSE, measured from their halves and taken from every error: {}.",
        references.join(", ")
    ));
    let seeds = settings.curves.seeds.max(settings.reruns.seeds).max(settings.filters.seeds);
    report.write(bench, &format!("0 to {}", seeds - 1))
}
