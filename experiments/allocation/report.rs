//! Writes the report of `allocation` from its measurements.

use super::ablation;
use super::goals::{self, gain_fraction, maps_and_true_error};
use super::map_effects::{self, AblatedScene};
use super::own_loop;
use super::scene_results::SceneResults;
use super::settings::Settings;
use crate::configuration::CONFIGURATIONS;
use crate::curves::{Curves, EqualCost, Metric, Point, clock_variance_of_ratio, curve, ratios};
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, number, range};
use crate::session::Session;
use crate::statistics::{Interval, geometric_mean, geometric_mean_with_shared_error, mean};
use crate::test_scene::groups;

/// Adaptive sampling is reported as worse above this ratio of errors at equal time.
const WORSE_RATIO: f64 = 1.05;
/// Indices in [`CONFIGURATIONS`]: uniform, adaptive.
const UNFILTERED: [usize; 2] = [0, 1];
pub const FILTERED: [usize; 2] = [2, 3];

/// Writes `report.md` and its plots.
pub fn write(session: &Session, settings: &Settings, all: &[SceneResults]) -> anyhow::Result<()> {
    let findings = [finding(all, &settings.spp), own_loop::finding(&settings.own_loop, all)];
    let mut report = Report::new("Is adaptive sampling better than uniform?", &findings.join("\n\n"));
    report.goals(&goals::goals(settings, all), "docs/method.md#adaptive-allocation");
    ratio_tables(&mut report, settings, all);
    other_metrics(&mut report, settings, all);
    own_loop::report(&mut report, &settings.own_loop, all);
    curves(session, &mut report, all)?;
    errors(&mut report, all);
    optimum(&mut report, settings, all);
    report.section("Contribution of each priority map");
    report.paragraph(&format!(
        "Filtered images at {} spp, whose samples follow the maps whatever gain is predicted.",
        settings.maps.spp
    ));
    map_effects::write(
        &mut report,
        &ablation::default_maps(),
        &all.iter().map(ablated).collect::<Vec<_>>(),
        &[EqualCost::Samples, EqualCost::Seconds],
    );
    sample_maps(&mut report, settings, all);
    let own_loop = &settings.own_loop;
    let seeds = settings.seeds.max(own_loop.seeds).max(own_loop.ablation_seeds);
    report.write(session, &format!("0 to {}", seeds - 1))
}

fn ratio_tables(report: &mut Report, settings: &Settings, all: &[SceneResults]) {
    report.section("Ratio of errors");
    report.paragraph(
        "relMSE, in one table ꟻLIP, of adaptive sampling divided by that of uniform sampling, geometric mean over the seeds (95 % interval). \
         Below 1 adaptive sampling is better. At equal seconds, both sides include the time of the filter, of its interim \
         passes and of the allocation, and intervals the spread of errors over seeds and that of times; between and beyond measured times, uniform sampling's error is interpolated \
         on logarithmic axes. Uniform images are filtered once, at the end. Constants were chosen on our scenes, `ajar` among them, and random ones; means are \
         over scenes, those of the public ones apart, with the interval of a mean over such scenes.",
    );
    let relmse: Metric = |p| p.error;
    for (title, configurations, equal, error) in [
        ("Filtered, at equal seconds", FILTERED, EqualCost::Seconds, relmse),
        ("Filtered, at equal samples", FILTERED, EqualCost::Samples, relmse),
        ("ꟻLIP, filtered, at equal seconds", FILTERED, EqualCost::Seconds, |p| p.flip),
        ("Unfiltered, at equal seconds", UNFILTERED, EqualCost::Seconds, relmse),
        ("Unfiltered, at equal samples", UNFILTERED, EqualCost::Samples, relmse),
    ] {
        report.paragraph(&format!("**{title}**"));
        let head = settings.spp.iter().map(|spp| format!("{spp} spp"));
        let head: Vec<String> = std::iter::once("scene".to_owned()).chain(head).collect();
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        report.table(&head, &ratio_rows(all, &settings.spp, configurations, equal, error));
    }
}

/// Tabulates ratios of relMSE without the worst pixels.
fn other_metrics(report: &mut Report, settings: &Settings, all: &[SceneResults]) {
    report.paragraph(
        "**relMSE without the worst 0.1 % of the pixels**, at equal seconds, of filtered and of unfiltered images.",
    );
    let metrics: [(&str, [usize; 2], Metric); 2] =
        [("filtered", FILTERED, |p| p.trimmed), ("unfiltered", UNFILTERED, |p| p.trimmed)];
    let mut rows = Vec::new();
    for (name, configurations, metric) in metrics {
        for (group, scenes) in groups(all, |m| m.is_public) {
            let intervals = settings.spp.iter().map(|&spp| {
                format_interval(over_scenes(metric, &scenes, spp, configurations, EqualCost::Seconds))
            });
            rows.push([name.to_owned(), group.to_owned()].into_iter().chain(intervals).collect());
        }
    }
    let spps = settings.spp.iter().map(|spp| format!("{spp} spp"));
    let head: Vec<String> = ["images".to_owned(), "scenes".to_owned()].into_iter().chain(spps).collect();
    report.table(&head.iter().map(String::as_str).collect::<Vec<_>>(), &rows);
}

fn curves(session: &Session, report: &mut Report, all: &[SceneResults]) -> anyhow::Result<()> {
    report.section("Error against samples and seconds");
    for (file, x, value) in [
        ("error-samples.svg", "samples per pixel", (|p| f64::from(p.spp)) as fn(&Point) -> f64),
        ("error-seconds.svg", "seconds", |p| p.seconds),
    ] {
        plot(all, x, value).write(&session.out.join(file))?;
        report.picture(
            file,
            &format!("relMSE against {x}, mean of the seeds; grey: slope −1, plain Monte Carlo."),
        );
    }
    Ok(())
}

fn sample_maps(report: &mut Report, settings: &Settings, all: &[SceneResults]) {
    report.section("Sample counts");
    for measured in all {
        report.picture(
            &measured.picture,
            &format!(
                "{}: filtered image; sample counts of adaptive sampling; true error of adaptive and of uniform sampling \
                 (on one scale), {} spp.",
                measured.scene, settings.maps.spp
            ),
        );
    }
}

fn points_of_spp(points: &[Point], spp: u32) -> Vec<Point> {
    points.iter().filter(|point| point.spp == spp).copied().collect()
}

/// Ratio of the errors of adaptive and uniform sampling on a scene.
pub fn ratio(
    error: Metric,
    measured: &SceneResults,
    spp: u32,
    [uniform, adaptive]: [usize; 2],
    equal: EqualCost,
) -> Interval {
    let Curves { points, clock_variance, .. } = &measured.curves;
    let (adaptive, uniform) = (points_of_spp(&points[adaptive], spp), &points[uniform]);
    let of_clock = match equal {
        EqualCost::Samples => 0.0,
        EqualCost::Seconds => clock_variance_of_ratio(&adaptive, uniform, error, *clock_variance),
    };
    geometric_mean_with_shared_error(&ratios(&adaptive, uniform, equal, error), of_clock)
}

/// Geometric mean of that over scenes.
pub fn over_scenes(
    error: Metric,
    all: &[&SceneResults],
    spp: u32,
    configurations: [usize; 2],
    equal: EqualCost,
) -> Interval {
    geometric_mean(&all.iter().map(|m| ratio(error, m, spp, configurations, equal).mean).collect::<Vec<_>>())
}

fn finding(all: &[SceneResults], spps: &[u32]) -> String {
    let last = spps.last().copied().unwrap_or(0);
    let gains = groups(all, |m| m.is_public).into_iter().map(|(group, scenes)| {
        let of_counts = |error: Metric, configurations: [usize; 2]| {
            // The last with its interval
            let of_count = |&spp: &u32| {
                let interval = over_scenes(error, &scenes, spp, configurations, EqualCost::Seconds);
                if spp == last { format_interval(interval) } else { format!("{:.2}", interval.mean) }
            };
            spps.iter().map(of_count).collect::<Vec<_>>().join(", ")
        };
        let by_scene = scenes.iter().map(|m| ratio(|p| p.error, m, last, FILTERED, EqualCost::Seconds).mean);
        format!(
            "on {group} ({}) {} times in filtered images (with {last} {} by scene), whose ꟻLIP is {} times as large, and {} \
             times in unfiltered ones, for which it chose uniform sampling on {} of the scenes",
            scenes.len(),
            of_counts(|p| p.error, FILTERED),
            range(by_scene, 2),
            of_counts(|p| p.flip, FILTERED),
            of_counts(|p| p.error, UNFILTERED),
            scenes.iter().filter(|m| chose_uniform(m, UNFILTERED, last)).count(),
        )
    });
    let at_last = |m: &SceneResults| ratio(|p| p.error, m, last, FILTERED, EqualCost::Seconds);
    let list = |chosen: &dyn Fn(&Interval) -> bool| {
        names(all, &|m| !chose_uniform(m, FILTERED, last) && chosen(&at_last(m)))
    };
    format!(
        "**At equal time and {} samples per pixel the relMSE of adaptive sampling relative to that of uniform sampling is {}.** \
         In filtered images with {last} samples per pixel adaptive sampling is better, with 95 % confidence, on {}; it is worse, \
         likewise, on {}; its error is more than {WORSE_RATIO} times as large on {}. It chose uniform sampling by itself, so that \
         only the times differ, on {}.",
        spps.iter().map(u32::to_string).collect::<Vec<_>>().join(", "),
        gains.collect::<Vec<_>>().join("; "),
        list(&|interval| interval.high < 1.0),
        list(&|interval| interval.low > 1.0),
        list(&|interval| interval.mean > WORSE_RATIO),
        names(all, &|m| chose_uniform(m, FILTERED, last)),
    )
}

/// Returns the names of chosen scenes.
pub fn names(all: &[SceneResults], chosen: &dyn Fn(&SceneResults) -> bool) -> String {
    let names: Vec<_> = all.iter().filter(|m| chosen(m)).map(|m| format!("`{}`", m.scene)).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Returns whether adaptive sampling gave the images of uniform sampling with every seed, since it predicted too small a gain. A
/// ratio of their errors at equal time tells the clock's noise alone.
fn chose_uniform(measured: &SceneResults, configurations: [usize; 2], spp: u32) -> bool {
    let [uniform, adaptive] = configurations.map(|i| {
        let points = points_of_spp(&measured.curves.points[i], spp);
        points.iter().map(|point| (point.seed, point.error)).collect::<Vec<_>>()
    });
    uniform == adaptive
}

/// Formats an interval as `0.81 (0.77 to 0.85)`.
pub fn format_interval(Interval { mean, low, high }: Interval) -> String {
    if low.is_finite() { format!("{mean:.2} ({low:.2} to {high:.2})") } else { format!("{mean:.2}") }
}

fn ratio_rows(
    all: &[SceneResults],
    spps: &[u32],
    configurations: [usize; 2],
    equal: EqualCost,
    error: Metric,
) -> Vec<Vec<String>> {
    let row = |name: &str, interval: &dyn Fn(u32) -> Interval| {
        std::iter::once(name.to_owned())
            .chain(spps.iter().map(|&spp| format_interval(interval(spp))))
            .collect()
    };
    let mut rows: Vec<Vec<String>> =
        all.iter().map(|m| row(&m.scene, &|spp| ratio(error, m, spp, configurations, equal))).collect();
    rows.extend(groups(all, |m| m.is_public).iter().map(|(group, scenes)| {
        row(&format!("**{group}**"), &|spp| over_scenes(error, scenes, spp, configurations, equal))
    }));
    rows
}

fn plot<'a>(all: &[SceneResults], x: &'a str, value: fn(&Point) -> f64) -> Plot<'a> {
    let panel = |m: &SceneResults| Panel {
        title: m.scene.clone(),
        series: CONFIGURATIONS
            .iter()
            .zip(&m.curves.points)
            .map(|(configuration, points)| {
                Series::new(configuration.name(), curve(points, None, value, |p| p.error))
            })
            .collect(),
    };
    Plot { x, y: "relMSE", panels: all.iter().map(panel).collect(), slope: true, columns: 3 }
}

fn errors(report: &mut Report, all: &[SceneResults]) {
    report.paragraph("relMSE, mean of the seeds ± half of its 95 % interval, and median seconds:");
    let mut rows = Vec::new();
    for m in all {
        for (configuration, points) in CONFIGURATIONS.iter().zip(&m.curves.points) {
            for (spp, _) in curve(points, None, |p| f64::from(p.spp), |p| p.error) {
                let chosen = points_of_spp(points, spp as u32);
                let error = mean(&chosen.iter().map(|p| p.error).collect::<Vec<_>>());
                rows.push(vec![
                    m.scene.clone(),
                    configuration.name().to_owned(),
                    number(spp, 1),
                    format!("{} ± {}", number(error.mean, 3), number(error.high - error.mean, 1)),
                    number(chosen.first().map_or(f64::NAN, |p| p.seconds), 3),
                ]);
            }
        }
    }
    report.table(&["scene", "configuration", "spp", "relMSE", "seconds"], &rows);
    let references: Vec<String> =
        all.iter().map(|m| format!("{} {}", m.scene, number(m.reference_relmse, 2))).collect();
    report.paragraph(&format!(
        "Expected relMSE of the references, from their halves, whose noise no error contains: {}.",
        references.join(", ")
    ));
}

/// The selections of maps on a scene.
pub fn ablated(measured: &SceneResults) -> AblatedScene<'_> {
    AblatedScene {
        scene: &measured.scene,
        uniform: &measured.curves.points[FILTERED[0]],
        ablations: &measured.ablations,
    }
}

fn optimum(report: &mut Report, settings: &Settings, all: &[SceneResults]) {
    report.section("Possible gain");
    let spp = settings.maps.spp;
    report.paragraph(&format!(
        "Filtered: the loop at {spp} spp, whose samples follow the maps whatever gain is predicted, and the same with the \
         true error of each interim image in place of its maps; this is no bound, but what the loop gains from perfect \
         knowledge of the error. Unfiltered: the program's own choice, and sample counts in proportion to \
         the pixels' relative standard deviation (Neyman 1934), the optimal allocation of independent samples, from the \
         variances in {spp} samples per pixel. Ratios to the error of uniform sampling at equal samples, and the fraction \
         of the possible gain that adaptive sampling reaches."
    ));
    let fraction = |reached: f64, possible: f64| {
        gain_fraction(reached, possible)
            .map_or("–".to_owned(), |v| format!("{:.0} %", (100.0 * v).round() + 0.0))
    };
    let row = |m: &SceneResults| {
        let [default, oracle] = maps_and_true_error(m);
        let unfiltered = ratio(|p| p.error, m, spp, UNFILTERED, EqualCost::Samples);
        vec![
            m.scene.clone(),
            format_interval(default),
            format_interval(oracle),
            fraction(default.mean, oracle.mean),
            format_interval(unfiltered),
            number(m.optimal_ratio, 2),
            fraction(unfiltered.mean, m.optimal_ratio),
        ]
    };
    let head = ["scene", "filtered", "with the true error", "fraction", "unfiltered", "optimum", "fraction"];
    report.table(&head, &all.iter().map(row).collect::<Vec<_>>());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_chose_uniform_sampling_if_the_images_of_all_seeds_are_the_same() {
        let points = |errors: [f64; 2]| {
            let point = |(seed, error): (u64, f64)| {
                let seconds = 1.0 + error;
                Point { spp: 64, seed, seconds, error, trimmed: error, flip: error, halving_seconds: None }
            };
            (0..).zip(errors).map(point).collect::<Vec<_>>()
        };
        for (adaptive, is_uniform) in [([0.1, 0.2], true), ([0.1, 0.15], false)] {
            let mut measured = SceneResults::default();
            measured.curves.points[FILTERED[0]] = points([0.1, 0.2]);
            measured.curves.points[FILTERED[1]] = points(adaptive);
            assert_eq!(chose_uniform(&measured, FILTERED, 64), is_uniform);
        }
    }
}
