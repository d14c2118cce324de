//! Do hard cases stay stable? Every case's measured figure beside its bound.

mod cases;
mod report;

use anyhow::ensure;
use serde::Deserialize;

use crate::bench::Bench;
use crate::ledger::{Key, values};
use cases::{Effort, SECTIONS};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    effort: Effort,
}

pub fn run(bench: &mut Bench) -> anyhow::Result<()> {
    let Settings { effort } = bench.settings()?;
    let program = cases::program();
    ensure!(program.is_file(), "found no {}; `cargo build --release` makes it", program.display());
    let mut measured = Vec::new();
    for section in &SECTIONS {
        bench.doing(section.name);
        let cases = (section.cases)(effort);
        for (index, case) in cases.iter().enumerate() {
            let key = Key::new(section.name, 0, format!("{index}: {}: {}", case.name, case.figure));
            bench.ledger.measure(key, &[], || {
                Ok(values([("measured", case.measured), ("passed", f64::from(case.passed()))]))
            })?;
        }
        measured.push((section.name, cases));
    }
    report::write(bench, &measured)
}
