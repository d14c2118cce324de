//! The report of `allocation`: all of its words that say more or less follow from numbers.

use super::drives::{DEFAULT, MAPS, ORACLE, names};
use super::{Measured, Settings};
use crate::bench::Bench;
use crate::curves::{Equal, Point, WAYS, curve, ratios};
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, number, range};
use crate::statistics::{Interval, geometric_mean, mean};

/// Adaptive sampling that leaves more than this of uniform's error at equal time is worse.
const WORSE: f64 = 1.05;
/// Places of the ways in [`WAYS`].
const UNFILTERED: [usize; 2] = [0, 1];
const FILTERED: [usize; 2] = [2, 3];

pub fn write(bench: &Bench, settings: &Settings, all: &[Measured]) -> anyhow::Result<()> {
    let most = settings.spp.last().copied().unwrap_or(0);
    let mut report = Report::new("Is adaptive sampling better than uniform?", &finding(all, most));
    report.section("Error over uniform's");
    report.paragraph(
        "Relative MSE of adaptive sampling over that of uniform sampling, geometric mean over the seeds (95 % interval). \
         Below 1 adaptive is better. At equal seconds, the time of the filter, of its reruns between the batches and of \
         allocation is counted on both sides; where a time lies between two measured ones, or beyond them, uniform's \
         error is read off a line through its neighbours on logarithmic axes.",
    );
    for (title, ways, equal) in [
        ("Filtered, at equal seconds", FILTERED, Equal::Seconds),
        ("Filtered, at equal samples", FILTERED, Equal::Samples),
        ("Unfiltered, at equal seconds", UNFILTERED, Equal::Seconds),
        ("Unfiltered, at equal samples", UNFILTERED, Equal::Samples),
    ] {
        report.paragraph(&format!("**{title}**"));
        let head = settings.spp.iter().map(|spp| format!("{spp} spp"));
        let head: Vec<String> = std::iter::once("scene".to_owned()).chain(head).collect();
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        report.table(&head, &ratio_rows(all, &settings.spp, ways, equal));
    }
    report.section("Error against samples and seconds");
    for (file, x, of) in [
        ("error-samples.svg", "samples per pixel", (|p| f64::from(p.spp)) as fn(&Point) -> f64),
        ("error-seconds.svg", "seconds", |p| p.seconds),
    ] {
        plot(all, x, of).write(&bench.out.join(file))?;
        report.picture(
            file,
            &format!("relMSE against {x}, mean of the seeds; grey: slope −1, plain Monte Carlo."),
        );
    }
    errors(&mut report, all);
    possible(&mut report, settings, all);
    maps(&mut report, settings, all);
    report.section("Where the samples went");
    for measured in all {
        report.picture(
            &measured.picture,
            &format!(
                "{}: filtered image; samples of adaptive sampling; true error of adaptive, and of uniform sampling (one \
                 scale), {} spp.",
                measured.scene, settings.maps.spp
            ),
        );
    }
    let seeds = format!("0 to {}", settings.seeds.max(settings.maps.seeds) - 1);
    report.write(bench, &seeds)
}

fn of_spp(points: &[Point], spp: u32) -> Vec<Point> {
    points.iter().filter(|point| point.spp == spp).copied().collect()
}

/// Adaptive's error over uniform's on a scene.
fn ratio(measured: &Measured, spp: u32, [uniform, adaptive]: [usize; 2], equal: Equal) -> Interval {
    let points = &measured.curves.points;
    geometric_mean(&ratios(&of_spp(&points[adaptive], spp), &points[uniform], equal))
}

fn over_scenes(all: &[Measured], spp: u32, ways: [usize; 2], equal: Equal) -> Interval {
    geometric_mean(&all.iter().map(|m| ratio(m, spp, ways, equal).mean).collect::<Vec<_>>())
}

fn finding(all: &[Measured], spp: u32) -> String {
    let gain = |ways| over_scenes(all, spp, ways, Equal::Seconds);
    let ratio = |m: &Measured| ratio(m, spp, FILTERED, Equal::Seconds);
    let list = |chosen: &dyn Fn(&Interval) -> bool| {
        let names: Vec<_> =
            all.iter().filter(|m| chosen(&ratio(m))).map(|m| format!("`{}`", m.scene)).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    };
    format!(
        "**At equal time adaptive sampling leaves {} of uniform's relMSE in filtered images ({} by scene) and {} in \
         unfiltered ones, at {spp} samples per pixel and {} scenes.** In filtered images it pays, with 95 % confidence, \
         on {}; it is worse than {WORSE} of uniform's on {}.",
        number(gain(FILTERED).mean, 2),
        range(all.iter().map(|m| ratio(m).mean), 2),
        number(gain(UNFILTERED).mean, 2),
        all.len(),
        list(&|interval| interval.high < 1.0),
        list(&|interval| interval.mean > WORSE),
    )
}

/// `0.81 (0.77 to 0.85)`.
fn shown(Interval { mean, low, high }: Interval) -> String {
    if low.is_finite() { format!("{mean:.2} ({low:.2} to {high:.2})") } else { format!("{mean:.2}") }
}

fn ratio_rows(all: &[Measured], spps: &[u32], ways: [usize; 2], equal: Equal) -> Vec<Vec<String>> {
    let row = |name: &str, of: &dyn Fn(u32) -> Interval| {
        std::iter::once(name.to_owned()).chain(spps.iter().map(|&spp| shown(of(spp)))).collect()
    };
    let mut rows: Vec<Vec<String>> =
        all.iter().map(|m| row(&m.scene, &|spp| ratio(m, spp, ways, equal))).collect();
    rows.push(row("**mean over scenes**", &|spp| over_scenes(all, spp, ways, equal)));
    rows
}

fn plot<'a>(all: &[Measured], x: &'a str, of: fn(&Point) -> f64) -> Plot<'a> {
    let panel = |m: &Measured| Panel {
        title: m.scene.clone(),
        series: WAYS
            .iter()
            .zip(&m.curves.points)
            .map(|(way, points)| Series::new(way.name(), curve(points, None, of)))
            .collect(),
    };
    Plot { x, y: "relMSE", panels: all.iter().map(panel).collect(), slope: true, columns: 3 }
}

fn errors(report: &mut Report, all: &[Measured]) {
    report.paragraph("relMSE, mean of the seeds ± half of its 95 % interval, and median seconds:");
    let mut rows = Vec::new();
    for m in all {
        for (way, points) in WAYS.iter().zip(&m.curves.points) {
            for (spp, _) in curve(points, None, |p| f64::from(p.spp)) {
                let chosen = of_spp(points, spp as u32);
                let error = mean(&chosen.iter().map(|p| p.error).collect::<Vec<_>>());
                rows.push(vec![
                    m.scene.clone(),
                    way.name().to_owned(),
                    number(spp, 1),
                    format!("{} ± {}", number(error.mean, 3), number(error.high - error.mean, 1)),
                    number(chosen.first().map_or(f64::NAN, |p| p.seconds), 3),
                ]);
            }
        }
    }
    report.table(&["scene", "way", "spp", "relMSE", "seconds"], &rows);
    let references: Vec<String> =
        all.iter().map(|m| format!("{} {}", m.scene, number(m.reference_error, 2))).collect();
    report.paragraph(&format!(
        "The references' own relMSE, measured from their halves and taken from every error: {}.",
        references.join(", ")
    ));
}

/// Error over uniform's at equal samples, by a choice of maps.
fn by_drive(measured: &Measured, name: &str, equal: Equal) -> Vec<f64> {
    let found = measured.drives.iter().find(|(drive, _)| drive.name == name);
    found.map_or(Vec::new(), |(_, points)| ratios(points, &measured.curves.points[FILTERED[0]], equal))
}

fn possible(report: &mut Report, settings: &Settings, all: &[Measured]) {
    report.section("What could be gained");
    let spp = settings.maps.spp;
    report.paragraph(&format!(
        "Filtered: the same loop at {spp} spp, driven by the true error of each rerun's image instead of its maps; no \
         bound, but what perfect knowledge of the error gives this loop. Unfiltered: samples in proportion to the pixels' \
         relative deviation (Neyman 1934), the least that any allocation of independent samples leaves, from the \
         variances seen in {spp} samples per pixel. Error over uniform's at equal samples; the share is that of the \
         possible gain which was reached."
    ));
    /// A share of less than this is a share of noise.
    const LEAST_GAIN: f64 = 0.05;
    let share = |reached: f64, possible: f64| {
        if 1.0 - possible < LEAST_GAIN {
            return "–".to_owned();
        }
        format!("{:.0} %", 100.0 * (1.0 - reached) / (1.0 - possible))
    };
    let row = |m: &Measured| {
        let [default, oracle] =
            [DEFAULT, ORACLE].map(|name| geometric_mean(&by_drive(m, name, Equal::Samples)));
        let unfiltered = ratio(m, spp, UNFILTERED, Equal::Samples);
        vec![
            m.scene.clone(),
            shown(default),
            shown(oracle),
            share(default.mean, oracle.mean),
            shown(unfiltered),
            number(m.ceiling, 2),
            share(unfiltered.mean, m.ceiling),
        ]
    };
    let head = ["scene", "filtered", "by true error", "share", "unfiltered", "best possible", "share"];
    report.table(&head, &all.iter().map(row).collect::<Vec<_>>());
}

fn maps(report: &mut Report, settings: &Settings, all: &[Measured]) {
    report.section("Which maps earn their place");
    let against_default = |name: &str, equal: Equal| {
        let of = |m: &Measured| {
            let [with, default] = [name, DEFAULT].map(|name| by_drive(m, name, equal));
            with.iter().zip(default).map(|(with, default)| with / default).collect::<Vec<_>>()
        };
        geometric_mean(&all.iter().map(|m| geometric_mean(&of(m)).mean).collect::<Vec<_>>())
    };
    let verdict = |map: &str| {
        let [alone, left_out] = names(map).map(|name| against_default(&name, Equal::Seconds));
        let word = if left_out.low > 1.0 {
            "earns its place"
        } else if left_out.high < 1.0 {
            "does harm"
        } else {
            "cannot be told from no effect"
        };
        format!(
            "* {map}: without it the error is {} of the default's, with it alone {}: it {word}.",
            shown(left_out),
            shown(alone)
        )
    };
    let verdicts: Vec<String> = MAPS.iter().map(|(map, _)| verdict(map)).collect();
    report.paragraph(&format!(
        "Filtered images at {} spp, at equal seconds, geometric mean over the scenes (95 % interval over them):\n\n{}",
        settings.maps.spp,
        verdicts.join("\n")
    ));
    let scenes: Vec<&str> = all.iter().map(|m| m.scene.as_str()).collect();
    let head = [&["driven by"], &scenes[..], &["mean", "mean at equal seconds"]].concat();
    let name_of = |i: usize| all.first().and_then(|m| m.drives.get(i)).map(|(drive, _)| drive.name.clone());
    let rows = (0..).map_while(name_of).map(|name| {
        let of = |m: &Measured, equal| geometric_mean(&by_drive(m, &name, equal)).mean;
        let overall = |equal| geometric_mean(&all.iter().map(|m| of(m, equal)).collect::<Vec<_>>()).mean;
        let numbers = all
            .iter()
            .map(|m| of(m, Equal::Samples))
            .chain([overall(Equal::Samples), overall(Equal::Seconds)])
            .map(|ratio| format!("{ratio:.2}"));
        std::iter::once(name.clone()).chain(numbers).collect()
    });
    report.paragraph("Error over uniform's at equal samples:");
    report.table(&head, &rows.collect::<Vec<_>>());
}
