//! Draws plots as SVG: lines on logarithmic axes, in panels.
//!
//! Takes named series of points; writes a file with a legend above the panels.

use std::path::Path;

use anyhow::anyhow;
use plotters::coord::ranged1d::DefaultFormatting;
use plotters::prelude::*;

/// Colours that colour-blind readers can tell apart (Okabe and Ito 2008).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
];

/// Width and height of a panel in pixels.
const PANEL: (u32, u32) = (380, 300);
/// Height of the legend above the panels, in pixels.
const LEGEND_HEIGHT: u32 = 26;
/// Width of a legend entry without its name, in pixels.
const ENTRY_WIDTH: u32 = 36;
/// Approximate width of a letter, in pixels.
const LETTER_WIDTH: u32 = 6;
/// Margin between the data and the ends of an axis, in decades.
const MARGIN: f64 = 0.08;
/// Shortest range of an axis in decades, so that small differences look small.
const MIN_DECADES: f64 = 0.8;

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// A named line. The order in which names appear in a plot decides their colours; a series without points
/// reserves the colour of its name.
#[derive(Clone, Debug)]
pub struct Series {
    pub name: String,
    pub points: Vec<(f64, f64)>,
    /// Whether a line joins the points.
    joined: bool,
}

impl Series {
    /// Points joined by a line.
    pub fn new(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.to_owned(), points: points.into_iter().collect(), joined: true }
    }

    /// Points without a line.
    pub fn points(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { joined: false, ..Self::new(name, points) }
    }
}

/// A pair of logarithmic axes.
#[derive(Clone, Debug)]
pub struct Panel {
    pub title: String,
    pub series: Vec<Series>,
}

/// Panels with the same axes.
pub struct Plot<'a> {
    pub x: &'a str,
    pub y: &'a str,
    pub panels: Vec<Panel>,
    /// Whether to draw lines of slope −1 behind the data: MSE of plain Monte Carlo against time or samples.
    pub slope: bool,
    pub columns: usize,
}

impl Plot<'_> {
    /// Writes the plot.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns).max(1);
        let size = (PANEL.0 * columns as u32, PANEL.1 * rows as u32 + LEGEND_HEIGHT);
        let area = SVGBackend::new(path, size).into_drawing_area();
        self.draw(&area, (rows, columns)).map_err(|error| anyhow!("{}: {error}", path.display()))
    }

    /// Draws the legend above panels in `shape` rows and columns.
    fn draw(&self, area: &Area, shape: (usize, usize)) -> DrawResult {
        area.fill(&WHITE)?;
        let (legend, panels) = area.split_vertically(LEGEND_HEIGHT);
        let names = self.names();
        self.draw_legend(&legend, &names)?;
        for (panel, area) in self.panels.iter().zip(panels.split_evenly(shape)) {
            self.draw_panel(&area, panel, &names)?;
        }
        area.present()?;
        Ok(())
    }

    /// Names of all series, in the order of their first appearance.
    fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        names
    }

    fn draw_legend(&self, area: &Area, names: &[&str]) -> DrawResult {
        let has_points = |name: &str| {
            let mut series = self.panels.iter().flat_map(|panel| &panel.series);
            series.any(|series| series.name == name && !series.points.is_empty())
        };
        let (mut x, y) = (12, LEGEND_HEIGHT as i32 / 2);
        for (i, &name) in names.iter().enumerate().filter(|(_, name)| has_points(name)) {
            area.draw(&PathElement::new([(x, y), (x + 16, y)], colour(i).stroke_width(3)))?;
            area.draw(&Text::new(name.to_owned(), (x + 20, y - 6), ("sans-serif", 12)))?;
            x += (ENTRY_WIDTH + LETTER_WIDTH * name.len() as u32) as i32;
        }
        Ok(())
    }

    /// Draws a panel; nothing if no point can be shown on logarithmic axes.
    fn draw_panel(&self, area: &Area, panel: &Panel, names: &[&str]) -> DrawResult {
        // Find the ranges of the axes
        let shown = |&(x, y): &(f64, f64)| x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite();
        let points = || panel.series.iter().flat_map(|series| &series.points).filter(|p| shown(p));
        if points().next().is_none() {
            return Ok(());
        }
        let (xs, ys) = (limits(points().map(|p| p.0)), limits(points().map(|p| p.1)));

        // Draw the axes
        let mut chart = ChartBuilder::on(area)
            .caption(&panel.title, ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(34)
            .y_label_area_size(58)
            .build_cartesian_2d(axis(xs), axis(ys))?;
        chart
            .configure_mesh()
            .x_desc(self.x)
            .y_desc(self.y)
            .x_label_formatter(&|value| label(*value))
            .y_label_formatter(&|value| label(*value))
            .light_line_style(WHITE)
            .draw()?;

        // Draw the lines of slope −1, then the data
        if self.slope {
            for line in slopes(xs, ys) {
                chart.draw_series(LineSeries::new(line, RGBColor(190, 190, 190)))?;
            }
        }
        for series in &panel.series {
            let colour = colour(names.iter().position(|name| *name == series.name).unwrap_or(0));
            let points: Vec<_> = series.points.iter().copied().filter(shown).collect();
            let line = if series.joined { points.clone() } else { Vec::new() };
            chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
            chart.draw_series(points.into_iter().map(|point| Circle::new(point, 3, colour.filled())))?;
        }
        Ok(())
    }
}

/// The colour of the series with this index among all names.
fn colour(index: usize) -> RGBColor {
    COLOURS[index % COLOURS.len()]
}

/// The range of an axis, from the smallest to the largest value and a margin.
fn limits(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    for value in values.map(f64::log10) {
        (min, max) = (min.min(value), max.max(value));
    }
    let margin = MARGIN.max(0.5 * (MIN_DECADES - (max - min)));
    (10_f64.powf(min - margin), 10_f64.powf(max + margin))
}

/// Lines of slope −1 through a plot, one decade apart, each as its two ends.
fn slopes(xs: (f64, f64), ys: (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let products = ((xs.0 * ys.0).log10().floor() as i32)..=((xs.1 * ys.1).log10().ceil() as i32);
    products
        .filter_map(|exponent| {
            let product = 10_f64.powi(exponent);
            let from = xs.0.max(product / ys.1);
            let to = xs.1.min(product / ys.0);
            (from < to).then(|| vec![(from, product / from), (to, product / to)])
        })
        .collect()
}

/// A logarithmic axis with these ends and its numbers.
fn axis(ends: (f64, f64)) -> impl Ranged<ValueType = f64, FormatOption = DefaultFormatting> {
    LogCoord::from((ends.0..ends.1).log_scale()).with_key_points(ticks(ends))
}

/// The numbers at an axis with these ends. Long axes have fewer for each decade, since they would overlap.
fn ticks((least, most): (f64, f64)) -> Vec<f64> {
    let mantissas: &[f64] = match (most / least).log10() {
        ..0.95 => &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        ..2.5 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let exponents = least.log10().floor() as i32..=most.log10().ceil() as i32;
    let ticks = exponents.flat_map(|exponent| mantissas.iter().map(move |m| m * 10_f64.powi(exponent)));
    ticks.filter(|tick| (least..=most).contains(tick)).collect()
}

/// Formats a number at an axis.
fn label(value: f64) -> String {
    if (0.01..10_000.0).contains(&value) {
        let text = format!("{value:.3}");
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    format!("{value:.0e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_show_all_values_and_at_least_most_of_a_decade() {
        let (least, most) = limits([8.0, 64.0].into_iter());
        assert!(least < 8.0 && most > 64.0 && most < 100.0, "{least} {most}");
        let (least, most) = limits([1.0, 1.01].into_iter());
        assert!((most / least).log10() > 0.79, "{least} {most}");
    }

    #[test]
    fn lines_of_slope_minus_one_stay_inside() {
        let lines = slopes((1.0, 100.0), (0.01, 1.0));
        assert!(!lines.is_empty());
        for line in lines {
            for (x, y) in &line {
                assert!((0.999..=100.001).contains(x) && (0.00999..=1.001).contains(y), "{line:?}");
            }
            assert!((line[0].0 * line[0].1 / (line[1].0 * line[1].1) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([8.0, 0.25, 1e-4, 20_000.0].map(label), ["8", "0.25", "1e-4", "2e4"]);
    }

    #[test]
    fn long_axes_have_fewer_numbers() {
        let numbers = |ends| -> Vec<String> { ticks(ends).into_iter().map(label).collect() };
        assert_eq!(numbers((0.45, 3.5)), ["0.5", "0.6", "0.7", "0.8", "0.9", "1", "2", "3"]);
        assert_eq!(numbers((0.035, 3.5)), ["0.05", "0.1", "0.2", "0.5", "1", "2"]);
        assert_eq!(numbers((0.0015, 3.5)), ["0.01", "0.1", "1"]);
    }

    #[test]
    fn every_number_is_drawn_once_at_an_axis() {
        let folder = tempfile::tempdir().unwrap();
        let drawn = |points: [(f64, f64); 2], number: &str| {
            let path = folder.path().join("a.svg");
            let panels = vec![Panel { title: "pool".into(), series: vec![Series::new("a", points)] }];
            Plot { x: "spp", y: "s", panels, slope: false, columns: 3 }.write(&path).unwrap();
            std::fs::read_to_string(&path).unwrap().lines().filter(|line| line.trim() == number).count()
        };
        assert_eq!(drawn([(1.0, 1.0), (1000.0, 1000.0)], "10"), 2, "over decades");
        assert_eq!(drawn([(2.0, 20.0), (8.0, 80.0)], "5"), 1, "below a decade");
    }

    #[test]
    fn a_plot_without_points_is_written_as_well() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        let series = vec![Series::new("a", [(8.0, f64::NAN)]), Series::new("b", [])];
        let panels = vec![Panel { title: "pool".into(), series }];
        Plot { x: "spp", y: "s", panels, slope: true, columns: 3 }.write(&path).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().contains("<svg"));
    }
}
