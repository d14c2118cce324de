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

/// A curve is drawn on to this many times its last seconds, and no further.
const REACH: f64 = 10.0;

/// When a way reaches an error on a scene.
fn reaches(measured: &Measured, way: usize, target: f64) -> Option<Passes> {
    let curve = curve(&measured.curves.points[way], None, |point| point.seconds);
    let last = curve.last().map_or(0.0, |point| point.0);
    let too_far = |passes: &Passes| matches!(passes, Passes::Beyond(seconds) if *seconds > REACH * last);
    passes(&curve, target).filter(|passes| !too_far(passes))
}

/// Speed-ups of the whole over plain path tracing to an error.
struct SpeedUps {
    target: f64,
    /// Of the scenes where both reach it, and not with their first image.
    ratios: Vec<f64>,
    /// How many of these rest on a curve that was drawn on.
    drawn_on: usize,
}

impl SpeedUps {
    fn new(all: &[Measured], target: f64) -> Self {
        let mut found = Self { target, ratios: Vec::new(), drawn_on: 0 };
        for measured in all {
            use Passes::{At, Beyond};
            match [PLAIN, WHOLE].map(|way| reaches(measured, way, target)) {
                [Some(At(plain)), Some(At(whole))] => found.ratios.push(plain / whole),
                [Some(At(plain) | Beyond(plain)), Some(At(whole) | Beyond(whole))] => {
                    found.ratios.push(plain / whole);
                    found.drawn_on += 1;
                }
                _ => {}
            }
        }
        found
    }
}

/// What the speed-ups say of the error that most scenes reach, in a sentence.
pub fn finding(settings: &Settings, all: &[Measured]) -> String {
    let found = settings.targets.iter().map(|&target| SpeedUps::new(all, target));
    let best = found.max_by_key(|s| (s.ratios.len(), std::cmp::Reverse(s.drawn_on)));
    let Some(SpeedUps { target, ratios, drawn_on }) = best.filter(|s| !s.ratios.is_empty()) else {
        return "**No error that was looked for is reached by both the program and plain path tracing.**"
            .to_owned();
    };
    format!(
        "**Adaptive and filtered, an image reaches relMSE {target} {} times sooner than by plain path tracing ({} on {} of {} \
         scenes{}).**",
        number(geometric_mean(&ratios).mean, 2),
        range(ratios.iter().copied(), 2),
        ratios.len(),
        all.len(),
        if drawn_on > 0 { format!(", {drawn_on} of them by curves drawn on") } else { String::new() },
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
        "`<` stands where the first image measured was better already; `~` where the last one was still worse and the \
         curve's last piece was drawn on, up to ten times its last seconds; `–` where that did not suffice.",
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
