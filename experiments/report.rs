//! Writes reports in Markdown: a finding, then tables and pictures, all computed from measurements.

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;

use crate::session::Session;
use crate::statistics::Interval;

/// A goal of the project, beside what was measured.
pub struct Goal {
    pub goal: String,
    pub measured: String,
    pub is_met: bool,
}

/// A report in progress.
pub struct Report {
    text: String,
}

impl Report {
    /// Starts a report with its title and its finding, a sentence or two.
    pub fn new(title: &str, finding: &str) -> Self {
        Self { text: format!("# {title}\n\n{finding}\n") }
    }

    /// Adds a heading.
    pub fn section(&mut self, title: &str) {
        let _ = write!(self.text, "\n## {title}\n");
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, text: &str) {
        let _ = write!(self.text, "\n{text}\n");
    }

    /// Adds a table. Rows shorter than its head are padded with empty cells.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        let _ = write!(self.text, "\n{}", table(head, rows));
    }

    /// Adds a table of goals. `explanation` is the section, from the root of the repository, that says why some are missed.
    pub fn goals(&mut self, goals: &[Goal], explanation: &str) {
        self.section("Goals");
        let is_met = |is_met| if is_met { "yes" } else { "no" }.to_owned();
        let row =
            |Goal { goal, measured, is_met: met }: &Goal| vec![goal.clone(), measured.clone(), is_met(*met)];
        self.table(&["goal", "measured", "met"], &goals.iter().map(row).collect::<Vec<_>>());
        if goals.iter().any(|goal| !goal.is_met) {
            self.paragraph(&format!(
                "Why some are missed, and what was tried: [{explanation}](../../../{explanation})."
            ));
        }
    }

    /// Adds a plot or picture by its name in the results folder.
    pub fn picture(&mut self, file: &str, caption: &str) {
        let _ = write!(self.text, "\n![{caption}]({file})\n\n{caption}\n");
    }

    /// Adds the command, commit, cores and seeds, and writes the report.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(mut self, session: &Session, seeds: &str) -> anyhow::Result<()> {
        let machine = &session.ledger.machine;
        self.section("How this was measured");
        self.paragraph(&format!(
            "`{}` at commit {} on {} cores; seeds {seeds}. [data.csv](data.csv) holds every measurement, the experiment's \
             `.toml` file its settings.",
            session.command(),
            machine.commit,
            machine.cores
        ));
        write(&session.out.join("report.md"), &self.text)
    }
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let escaped = |cell: &str| cell.replace('|', "\\|").replace('\n', " ");
    let line = |cells: &mut dyn Iterator<Item = String>| {
        format!("| {} |\n", cells.map(|cell| escaped(&cell)).collect::<Vec<_>>().join(" | "))
    };
    let mut text = line(&mut head.iter().map(|&cell| cell.to_owned()));
    text.push_str(&"| --- ".repeat(head.len()));
    text.push_str("|\n");
    for row in rows {
        let cell = |i: usize| row.get(i).cloned().unwrap_or_default();
        text.push_str(&line(&mut (0..head.len()).map(cell)));
    }
    text
}

/// Formats a number with `digits` significant digits: `0.00123`, `12.3`, `1230`. Very small and very large numbers
/// get a power of ten.
pub fn number(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..6).contains(&exponent) {
        return format!("{value:.*e}", (digits - 1).max(0) as usize);
    }
    format!("{value:.*}", (digits - 1 - exponent).max(0) as usize)
}

/// Formats the range of the finite values as `a to b`, or as one number if both read the same.
pub fn range(values: impl IntoIterator<Item = f64>, digits: i32) -> String {
    let values: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    let min = values.iter().copied().fold(f64::INFINITY, f64::min);
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let [min, max] = [min, max].map(|value| number(value, digits));
    if min == max { min } else { format!("{min} to {max}") }
}

/// Formats a value and its interval: `0.91 (0.85 to 0.97)`.
pub fn with_interval(Interval { mean, low, high }: Interval, digits: i32) -> String {
    let [mean, low, high] = [mean, low, high].map(|value| (value, number(value, digits)));
    if low.0.is_finite() { format!("{} ({} to {})", mean.1, low.1, high.1) } else { mean.1 }
}

/// Median of the finite values; of an even number, the mean of the middle two. NaN if there are none.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    0.5 * (values[(n - 1) / 2] + values[n / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_have_a_cell_for_each_head_and_no_bars_of_their_own() {
        let rows = [vec!["a|b".to_owned(), "1".to_owned()], vec!["c".to_owned()]];
        let expected = "| x | y |\n| --- | --- |\n| a\\|b | 1 |\n| c |  |\n";
        assert_eq!(table(&["x", "y"], &rows), expected);
    }

    #[test]
    fn goals_that_are_missed_are_explained() {
        let goals = |met: [bool; 2]| {
            let mut report = Report::new("x", "y");
            let goals = met.map(|is_met| Goal { goal: "fast".into(), measured: "3".into(), is_met });
            report.goals(&goals, "docs/a.md#b");
            report.text
        };
        assert!(goals([true, false]).contains("| fast | 3 | no |\n\nWhy some are missed"));
        assert!(!goals([true, true]).contains("missed"));
    }

    #[test]
    fn numbers_have_the_significant_digits_asked_for() {
        let numbers = [0.001_234, 12.34, 1234.0, 0.0, 1.5e-7, f64::NAN].map(|value| number(value, 3));
        assert_eq!(numbers, ["0.00123", "12.3", "1234", "0", "1.50e-7", "–"]);
    }

    #[test]
    fn ranges_and_medians_leave_out_values_that_are_not_finite() {
        assert_eq!(range([3.0, f64::NAN, 1.0], 2), "1.0 to 3.0");
        assert_eq!(range([2.0], 2), "2.0");
        assert_eq!(range([], 2), "–");
        assert_eq!(median([4.0, 1.0, f64::NAN, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0]), 2.5);
        assert!(median([]).is_nan());
    }
}
