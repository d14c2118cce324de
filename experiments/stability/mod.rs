//! The experiment `stability`: do hard cases stay stable?
//!
//! Runs the cases of `tests/stability.rs` at full length and reports each measured figure with its bound.

mod cases;
mod report;

use anyhow::ensure;
use serde::Deserialize;

use crate::ledger::{Key, values};
use crate::session::Session;
use cases::SECTIONS;
use cases::effort::Effort;

/// The settings, from `stability.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    effort: Effort,
}

/// Runs the experiment.
pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let Settings { effort } = session.settings()?;
    let program = cases::program::program();
    ensure!(program.is_file(), "{} is missing; `cargo build --release` builds it", program.display());
    let mut measured = Vec::new();
    for section in &SECTIONS {
        session.show_status(section.name);
        let cases = (section.cases)(effort);
        for (index, case) in cases.iter().enumerate() {
            let key = Key::new(section.name, 0, format!("{index}: {}: {}", case.name, case.figure));
            session.ledger.measure(key, &[], || {
                Ok(values([("measured", case.measured), ("passed", f64::from(case.passed()))]))
            })?;
        }
        measured.push((section.name, cases));
    }
    report::write(session, &measured)
}
