//! Writes the report of `stability`.

use super::cases::case::{Case, number};
use crate::report::Report;
use crate::session::Session;

/// Writes `report.md` from the sections' names and cases.
pub fn write(session: &Session, sections: &[(&str, Vec<Case>)]) -> anyhow::Result<()> {
    let all = || sections.iter().flat_map(|(_, cases)| cases);
    let holding = all().filter(|case| case.passed()).count();
    let finding = format!(
        "{holding} of {} hard cases hold{}. {} of them hold with a limitation, for the reasons given.",
        all().count(),
        failing(all()),
        all().filter(|case| case.passed() && case.limitation.is_some()).count()
    );
    let mut report = Report::new("Do hard cases stay stable?", &finding);
    report.paragraph(
        "Cases that begin with *planted* contain an error that the test has to detect. \"The same\" is the case above. A \
         z-score beyond 4.5 is not due to chance: over all tests of this report together it happens at most once in a \
         thousand runs.",
    );
    for (name, cases) in sections {
        report.section(name);
        let rows: Vec<Vec<String>> = cases.iter().map(row).collect();
        report.table(&["case", "figure", "bound", "measured", "passed"], &rows);
    }
    let limited = || all().filter(|case| case.limitation.is_some());
    if limited().next().is_some() {
        report.section("Limitations");
        let rows: Vec<Vec<String>> = limited()
            .map(|case| vec![case.name.clone(), case.limitation.unwrap_or_default().to_owned()])
            .collect();
        report.table(&["case", "reason, and what holds instead"], &rows);
    }
    report.write(session, "fixed in the cases")
}

fn failing<'a>(cases: impl Iterator<Item = &'a Case>) -> String {
    let name = |case: &Case| format!("{} ({})", case.name, case.figure);
    let names: Vec<String> = cases.filter(|case| !case.passed()).map(name).collect();
    if names.is_empty() { String::new() } else { format!("; these fail: {}", names.join(", ")) }
}

fn row(case: &Case) -> Vec<String> {
    let passed = if case.passed() { "yes" } else { "**no**" };
    vec![
        case.name.clone(),
        case.figure.to_owned(),
        case.bound.to_string(),
        number(case.measured),
        passed.to_owned(),
    ]
}
