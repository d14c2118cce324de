//! Do hard cases stay stable? Every case's measured figure beside its bound.

mod cases;
mod report;

use anyhow::ensure;
use serde::Deserialize;

use crate::ledger::{Key, values};
use crate::session::Session;
use cases::{Effort, SECTIONS};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    effort: Effort,
}

pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let Settings { effort } = session.settings()?;
    let program = cases::program();
    ensure!(program.is_file(), "found no {}; `cargo build --release` makes it", program.display());
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
