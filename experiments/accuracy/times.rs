//! Seconds to an error: how much sooner the program gets there than plain path tracing.

use super::{Measured, Settings};
use crate::bench::Bench;
use crate::curves::{WAYS, curve};
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, number, range};
use crate::statistics::{Passes, geometric_mean, passes};

/// Places in [`WAYS`]: plain path tracing, and what the program does without being told otherwise.
const PLAIN: usize = 0;
const WHOLE: usize = 3;

/// When a way reaches an error on a scene.
fn reaches(measured: &Measured, way: usize, target: f64) -> Option<Passes> {
    passes(&curve(&measured.curves.points[way], None, |point| point.seconds), target)
}

/// Seconds of it, known or drawn on; of an error that the first image is below, none.
fn seconds(passes: Option<Passes>) -> f64 {
    match passes {
        Some(Passes::At(seconds) | Passes::Beyond(seconds)) => seconds,
        Some(Passes::Before(_)) | None => f64::NAN,
    }
}

/// Speed-ups of the whole over plain path tracing, and whether one of them was drawn on.
fn speed_ups(all: &[Measured], target: f64) -> (Vec<f64>, bool) {
    let (mut ratios, mut beyond) = (Vec::new(), false);
    for measured in all {
        let [plain, whole] = [PLAIN, WHOLE].map(|way| reaches(measured, way, target));
        let ratio = seconds(plain) / seconds(whole);
        if ratio.is_finite() {
            ratios.push(ratio);
            beyond |= [plain, whole].iter().any(|passes| matches!(passes, Some(Passes::Beyond(_))));
        }
    }
    (ratios, beyond)
}

/// What the speed-ups say, in a sentence.
pub fn finding(settings: &Settings, all: &[Measured]) -> String {
    let said = settings.targets.iter().filter_map(|&target| {
        let (ratios, beyond) = speed_ups(all, target);
        let drawn = if beyond { ", some of it drawn on" } else { "" };
        (ratios.len() >= all.len().div_ceil(2)).then(|| {
            format!(
                "to relMSE {target} {} times faster ({} on {} scenes{drawn})",
                number(geometric_mean(&ratios).mean, 2),
                range(ratios.iter().copied(), 2),
                ratios.len()
            )
        })
    });
    format!(
        "**Adaptive and filtered, the program gets there sooner than plain path tracing: {}.**",
        said.collect::<Vec<_>>().join("; ")
    )
}

/// Writes the section.
pub fn write(
    bench: &Bench,
    report: &mut Report,
    settings: &Settings,
    all: &[Measured],
) -> anyhow::Result<()> {
    report.section("Seconds to an error");
    let panel = |m: &Measured| Panel {
        title: m.scene.clone(),
        series: WAYS
            .iter()
            .zip(&m.curves.points)
            .map(|(way, points)| Series::new(way.name(), curve(points, None, |point| point.seconds)))
            .collect(),
    };
    let panels = all.iter().map(panel).collect();
    Plot { x: "seconds", y: "relMSE", panels, slope: true, columns: 3 }
        .write(&bench.out.join("error-seconds.svg"))?;
    report.picture(
        "error-seconds.svg",
        "relMSE against seconds, mean of the seeds; grey: slope −1, plain Monte Carlo.",
    );
    report.paragraph(
        "`< 0.1` means that the first image measured was better already; `~` stands where the last one was still worse \
         and the curve's last piece was drawn on, which flatters ways whose error falls more slowly the longer they run; \
         `–` where it did not fall.",
    );
    let cell = |passes: Option<Passes>| match passes {
        Some(Passes::Before(seconds)) => format!("< {}", number(seconds, 2)),
        Some(Passes::At(seconds)) => number(seconds, 2),
        Some(Passes::Beyond(seconds)) => format!("~ {}", number(seconds, 2)),
        None => "–".to_owned(),
    };
    let mut rows = Vec::new();
    for m in all {
        for (way, of) in WAYS.iter().enumerate() {
            let cells = settings.targets.iter().map(|&target| cell(reaches(m, way, target)));
            rows.push([m.scene.clone(), of.name().to_owned()].into_iter().chain(cells).collect());
        }
    }
    let targets: Vec<String> = settings.targets.iter().map(|target| format!("relMSE {target}")).collect();
    let head: Vec<&str> = ["scene", "way"].into_iter().chain(targets.iter().map(String::as_str)).collect();
    report.table(&head, &rows);
    Ok(())
}
