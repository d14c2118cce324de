//! Reports the seconds to reach an error, and the speed-up over plain path tracing.

use super::scene_results::SceneResults;
use super::settings::Settings;
use crate::configuration::{CONFIGURATIONS, DEFAULT, PLAIN};
use crate::curves::curve;
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, median, number, range};
use crate::session::Session;
use crate::statistics::{Crossing, Interval, crossing, geometric_mean};

/// Curves are extrapolated to this many times their last seconds.
const MAX_EXTRAPOLATION: f64 = 10.0;

/// When a configuration reaches an error on a scene.
fn seconds_to(measured: &SceneResults, configuration: usize, target: f64) -> Option<Crossing> {
    let curve = curve(&measured.curves.points[configuration], None, |p| p.seconds, |p| p.error);
    let last = curve.last().map_or(0.0, |point| point.0);
    let too_far = |crossing: &Crossing| matches!(crossing, Crossing::Beyond(seconds) if *seconds > MAX_EXTRAPOLATION * last);
    crossing(&curve, target).filter(|crossing| !too_far(crossing))
}

/// Speed-ups of the default over plain path tracing at an error.
#[derive(Default)]
struct SpeedUps {
    /// Of the scenes where both reach the error later than with their first image.
    ratios: Vec<f64>,
    /// How many of these come from an extrapolated curve.
    extrapolated: usize,
    /// Where the first image of the default is good enough, and plain path tracing reaches the error: the time of plain path tracing over that
    /// of the first image, which is less than the speed-up.
    bounds: Vec<(String, f64)>,
    /// Where the default reaches the error and plain path tracing does not come near it: the last time of plain path tracing over that of the
    /// default, which is less than the speed-up.
    unreached: Vec<f64>,
}

impl SpeedUps {
    fn new(all: &[SceneResults], target: f64) -> Self {
        let mut found = Self::default();
        for measured in all {
            use Crossing::{At, Before, Beyond};
            match [PLAIN, DEFAULT].map(|configuration| seconds_to(measured, configuration, target)) {
                [Some(At(plain)), Some(At(default))] => found.ratios.push(plain / default),
                [Some(At(plain) | Beyond(plain)), Some(At(default) | Beyond(default))] => {
                    found.ratios.push(plain / default);
                    found.extrapolated += 1;
                }
                [Some(At(plain) | Beyond(plain)), Some(Before(default))] => {
                    found.bounds.push((measured.scene.clone(), plain / default));
                }
                [None, Some(At(default) | Beyond(default) | Before(default))] => {
                    let last = measured.curves.points[PLAIN].iter().map(|point| point.seconds);
                    found.unreached.push(last.fold(0.0, f64::max) / default);
                }
                _ => {}
            }
        }
        found
    }
}

/// The finding, in a sentence: the speed-up at the smallest target.
pub fn finding(settings: &Settings, all: &[SceneResults]) -> String {
    let target = settings.targets.iter().copied().fold(f64::INFINITY, f64::min);
    let found = SpeedUps::new(all, target);
    if found.ratios.is_empty() {
        return format!(
            "**On no scene do both the program and plain path tracing reach relMSE {target} later than with their first image.**"
        );
    }
    let SpeedUps { ratios, extrapolated, bounds, unreached } = found;
    let Interval { mean, low, high } = geometric_mean(&ratios);
    let bounds_of_firsts = bounds.iter().map(|(_, bound)| *bound);
    let least = median(ratios.iter().copied().chain(bounds_of_firsts).chain(unreached.iter().copied()));
    let bounds: Vec<String> =
        bounds.iter().map(|(scene, bound)| format!("{} on `{scene}`", number(*bound, 2))).collect();
    let bounds = if bounds.is_empty() {
        String::new()
    } else {
        format!(" Where the first image is good enough the factor is more than {}.", bounds.join(", "))
    };
    format!(
        "**Adaptive and filtered, an image reaches relMSE {target} {} times sooner than with plain path tracing (95 % interval {} to {}; {} on {} of \
         {} scenes, {extrapolated} of them extrapolated).**{bounds} On {} scenes plain path tracing does not come near. \
         Where only a bound is known that counts: at least {} times sooner in the median of the scenes that the program brings to this error.",
        number(mean, 2),
        number(low, 2),
        number(high, 2),
        range(ratios.iter().copied(), 2),
        ratios.len(),
        all.len(),
        unreached.len(),
        number(least, 2),
    )
}

/// Writes the section.
pub fn write(
    session: &Session,
    report: &mut Report,
    settings: &Settings,
    all: &[SceneResults],
) -> anyhow::Result<()> {
    // Plot the curves
    report.section("Seconds to an error");
    let panel = |m: &SceneResults| Panel {
        title: m.scene.clone(),
        series: CONFIGURATIONS
            .iter()
            .zip(&m.curves.points)
            .map(|(configuration, points)| {
                Series::new(configuration.name(), curve(points, None, |p| p.seconds, |p| p.error))
            })
            .collect(),
    };
    let panels = all.iter().map(panel).collect();
    Plot { x: "seconds", y: "relMSE", panels, slope: true, columns: 3 }
        .write(&session.out.join("error-seconds.svg"))?;
    report.picture(
        "error-seconds.svg",
        "relMSE against seconds, mean of the seeds; grey: slope −1, plain Monte Carlo.",
    );

    // Tabulate the seconds to each target
    report.paragraph(
        "`<`: the first measured image was better already. `~`: the last one was worse, and the curve's last segment was \
         extrapolated, at most to ten times its last seconds. `–`: the error was not reached.",
    );
    let cell = |crossing: Option<Crossing>| match crossing {
        Some(Crossing::Before(seconds)) => format!("< {}", number(seconds, 2)),
        Some(Crossing::At(seconds)) => number(seconds, 2),
        Some(Crossing::Beyond(seconds)) => format!("~ {}", number(seconds, 2)),
        None => "–".to_owned(),
    };
    let mut rows = Vec::new();
    for m in all {
        for (i, configuration) in CONFIGURATIONS.iter().enumerate() {
            let cells = settings.targets.iter().map(|&target| cell(seconds_to(m, i, target)));
            rows.push([m.scene.clone(), configuration.name().to_owned()].into_iter().chain(cells).collect());
        }
    }
    let targets: Vec<String> = settings.targets.iter().map(|target| format!("relMSE {target}")).collect();
    let head: Vec<&str> =
        ["scene", "configuration"].into_iter().chain(targets.iter().map(String::as_str)).collect();
    report.table(&head, &rows);
    Ok(())
}
