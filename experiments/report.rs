//! A report in Markdown: a finding first, then tables and pictures, all of them written from
//! measurements.

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;

use crate::bench::Bench;

/// Text that grows from the top.
pub struct Report {
    text: String,
}

impl Report {
    /// A title, and the finding in a sentence or two.
    pub fn new(title: &str, finding: &str) -> Self {
        Self { text: format!("# {title}\n\n{finding}\n") }
    }

    pub fn section(&mut self, title: &str) {
        let _ = write!(self.text, "\n## {title}\n");
    }

    pub fn paragraph(&mut self, text: &str) {
        let _ = write!(self.text, "\n{text}\n");
    }

    /// A table; rows shorter than its head are filled up.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        let _ = write!(self.text, "\n{}", table(head, rows));
    }

    /// A plot or picture, by its name in the results folder.
    pub fn picture(&mut self, file: &str, caption: &str) {
        let _ = write!(self.text, "\n![{caption}]({file})\n\n{caption}\n");
    }

    /// Ends the report with how it was made, and writes it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(mut self, bench: &Bench, seeds: &str) -> anyhow::Result<()> {
        let machine = &bench.ledger.machine;
        self.section("How this was made");
        self.paragraph(&format!(
            "`{}` at commit {} on {} cores; seeds {seeds}. Every measurement is in [data.csv](data.csv), and what was run \
             in the experiment's `.toml`.",
            bench.command(),
            machine.commit,
            machine.cores
        ));
        write(&bench.out.join("report.md"), &self.text)
    }
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("writing {}", path.display()))
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

/// A number with so many significant digits: `0.00123`, `12.3`, `1230`; in powers of ten where it is very
/// small or large.
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

/// The least and the largest of some numbers as `a to b`, or as one where they read the same.
pub fn range(values: impl IntoIterator<Item = f64>, digits: i32) -> String {
    let values: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let [least, most] = [least, most].map(|value| number(value, digits));
    if least == most { least } else { format!("{least} to {most}") }
}

/// The middle of some numbers; of an even number of them the mean of both middles. NaN of none.
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
    fn numbers_have_their_significant_digits() {
        let numbers = [0.001_234, 12.34, 1234.0, 0.0, 1.5e-7, f64::NAN].map(|value| number(value, 3));
        assert_eq!(numbers, ["0.00123", "12.3", "1234", "0", "1.50e-7", "–"]);
    }

    #[test]
    fn ranges_and_medians_are_of_what_is_finite() {
        assert_eq!(range([3.0, f64::NAN, 1.0], 2), "1.0 to 3.0");
        assert_eq!(range([2.0], 2), "2.0");
        assert_eq!(range([], 2), "–");
        assert_eq!(median([4.0, 1.0, f64::NAN, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0]), 2.5);
        assert!(median([]).is_nan());
    }
}
