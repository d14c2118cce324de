//! The report on the hard cases.

use super::cases::{Case, number};
use crate::report::Report;
use crate::session::Session;

/// Sections with their cases.
pub fn write(session: &Session, sections: &[(&str, Vec<Case>)]) -> anyhow::Result<()> {
    let all = || sections.iter().flat_map(|(_, cases)| cases);
    let holding = all().filter(|case| case.passed()).count();
    let finding = format!(
        "{holding} of {} hard cases hold{}. {} of them hold in another form than was asked for, for the reasons given.",
        all().count(),
        failing(all()),
        all().filter(|case| case.passed() && case.instead.is_some()).count()
    );
    let mut report = Report::new("Do hard cases stay stable?", &finding);
    report.paragraph(
        "Cases that begin with *planted* contain a fault that the comparison beside them has to notice. \"The same\" \
         is the case above. A deviation of a normal variable beyond 4.5 is no accident: over all such comparisons of \
         this report together it happens once in a thousand runs or less.",
    );
    for (name, cases) in sections {
        report.section(name);
        let rows: Vec<Vec<String>> = cases.iter().map(row).collect();
        report.table(&["case", "figure", "bound", "measured", "passed"], &rows);
    }
    let instead = || all().filter(|case| case.instead.is_some());
    if instead().next().is_some() {
        report.section("What cannot hold as it was asked for");
        let rows: Vec<Vec<String>> = instead()
            .map(|case| vec![case.name.clone(), case.instead.unwrap_or_default().to_owned()])
            .collect();
        report.table(&["case", "why, and what holds"], &rows);
    }
    report.write(session, "fixed in the cases")
}

fn failing<'a>(cases: impl Iterator<Item = &'a Case>) -> String {
    let name = |case: &Case| format!("{} ({})", case.name, case.figure);
    let names: Vec<String> = cases.filter(|case| !case.passed()).map(name).collect();
    if names.is_empty() { String::new() } else { format!("; these do not: {}", names.join(", ")) }
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
