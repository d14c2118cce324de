//! Writes the report of `accuracy` from its measurements.

use super::pareto_front::ParetoFront;
use super::scene_results::SceneResults;
use super::settings::Settings;
use super::{agreement, halving, interim_passes, target_errors, times};
use crate::report::{Report, number};
use crate::session::Session;

/// Writes `report.md` and its plots.
pub fn write(session: &Session, settings: &Settings, all: &[SceneResults]) -> anyhow::Result<()> {
    let front = ParetoFront::new(settings, all);
    let findings = [
        times::finding(settings, all),
        front.finding(),
        agreement::finding(all),
        format!("{} {}", halving::finding(all), target_errors::finding(all)),
    ];
    let mut report = Report::new("What does accuracy cost in time?", &findings.join("\n\n"));
    let mut goals = agreement::goals(all);
    goals.extend([target_errors::goal(all), halving::goal(all)]);
    report.goals(&goals, "docs/loop.md#the-error-estimate");
    times::write(session, &mut report, settings, all)?;
    front.write(session, &mut report)?;
    interim_passes::write(&mut report, &settings.interim_passes, all);
    agreement::write(&mut report, all);
    halving::write(&mut report, all);
    target_errors::write(&mut report, &settings.target_errors, all);
    report.section("References");
    let references: Vec<String> =
        all.iter().map(|m| format!("{} {}", m.scene, number(m.reference_relmse, 2))).collect();
    report.paragraph(&format!(
        "Expected relMSE of the references, from their halves, whose noise no error contains: {}.",
        references.join(", ")
    ));
    let Settings { curves, interim_passes, filters, target_errors, .. } = settings;
    let seeds = [curves.seeds, interim_passes.seeds, filters.seeds, target_errors.seeds].into_iter().max();
    report.write(session, &format!("0 to {}", seeds.unwrap_or(1) - 1))
}
