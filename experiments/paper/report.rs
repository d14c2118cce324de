//! Writes the report of `paper`: the claims, then plots, pictures and tables.

use prpf::filter::PrpfSettings;

use super::claims::{claims, finding};
use super::crop_measurement::PICTURES;
use super::interpretations::interpretations;
use super::scene_results::{
    EQUAL_TIME, INTERPRETATION, NLM, PRPF, REFERENCE, RPF, SceneResults, TIME_OVER_RPF, UNFILTERED,
    UPSAMPLING, WHOLE, at, mse_of_side,
};
use super::settings::Settings;
use super::stage_timer::STAGES;
use super::weight_maps::{COMPUTATIONS, GROUPS};
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, number, range, with_interval};
use crate::session::Session;
use crate::statistics::Interval;

/// The methods, with their names in plots and tables.
const METHODS: [(&str, &str); 4] = [(UNFILTERED, "unfiltered"), (RPF, "RPF"), (PRPF, "P-RPF"), (NLM, "nlm")];
/// Panels beside each other in a plot.
const COLUMNS: usize = 3;

/// Writes `report.md` and its plots.
///
/// # Errors
/// Files that cannot be written.
pub fn write(
    session: &Session,
    settings: &Settings,
    scenes: &[SceneResults],
    missing: &[String],
) -> anyhow::Result<()> {
    let claims = claims(scenes, settings);
    let mut report = Report::new("Do the paper's claims hold here?", &finding(&claims, scenes, settings));
    let head = ["claim", "paper", "here, its scenes", "here, our scenes", "`nlm`", "holds", "explanation"];
    let rows = claims.iter().map(|claim| {
        let [theirs, ours] = claim.ours.clone();
        let cells = [claim.claim, claim.paper].map(str::to_owned).into_iter();
        cells.chain([theirs, ours, claim.nlm.clone(), claim.verdict(), claim.explanation.clone()]).collect()
    });
    report.table(&head, &rows.collect::<Vec<Vec<String>>>());
    report.paragraph(&conditions(settings, scenes, missing));
    runs_of_rpf(settings, scenes, &mut report);
    plots(session, settings, scenes, &mut report)?;
    equal_time(settings, scenes, &mut report);
    weights(settings, scenes, &mut report);
    other_interpretations(settings, scenes, &mut report);
    tables(settings, scenes, &mut report);
    let seeds = settings.seeds.max(1);
    report.write(session, &format!("from 0, {seeds} unless said otherwise (references: two others)"))
}

/// Describes the conditions of the measurements.
fn conditions(settings: &Settings, scenes: &[SceneResults], missing: &[String]) -> String {
    let percent_of_prpf = |reference: &str, prpf: &str| {
        let percent = |scene: &SceneResults| 100.0 * scene.get(reference, "mse") / scene.get(prpf, "mse");
        format!("{} %", range(scenes.iter().map(percent), 2))
    };
    let at_equal_time = |method: &str| format!("{EQUAL_TIME} {method}");
    let left_out = if missing.is_empty() {
        String::new()
    } else {
        format!(" Left out, because their files are missing: {}.", missing.join(", "))
    };
    // Extrapolate the time of RPF from the crops to the images
    let minutes = |spp: u32| {
        range(
            scenes.iter().map(|scene| {
                1e-6 * scene.get(REFERENCE, "pixels of the image") * scene.at(RPF, spp, "seconds") / 60.0
            }),
            2,
        )
    };
    let pixels = range(scenes.iter().map(|scene| scene.get(REFERENCE, "pixels of the crop")), 1);

    // Compare the margin with the largest window
    let margin_suffices = PrpfSettings::paper().windows.iter().all(|window| window / 2 <= settings.margin);
    let max_spp = scenes.iter().filter_map(SceneResults::max_rpf_spp).max().unwrap_or(settings.base_spp);
    let with_max = scenes.iter().filter(|scene| scene.max_rpf_spp() == Some(max_spp)).count();
    format!(
        "RPF would take {} minutes for these images at {} samples per pixel and {} at {max_spp} (on {with_max} of them). It \
         therefore runs on a square in the middle of a crop of each scene, and every other method on the crop. The crop has \
         {pixels} pixels and {} seeds (seed 0 alone for samples beyond the threshold, weights and whole images); the table of \
         runs gives RPF's squares and seeds, which differ between sample counts. Every other method also runs on RPF's \
         square, with its seeds and after it: errors and times of the filter are compared there. Three figures use runs on \
         the crop as well: P-RPF at 32 samples over RPF at 8, P-RPF with statistics of all pixels, and other interpretations \
         of P-RPF. Around crop and square a margin of {} pixels ({} as the largest window reaches) is filtered and not \
         compared. Growth with samples is measured on the same pixels at both counts: RPF's time on the square of its \
         largest count, errors beside RPF's on its smallest square, everything else on the crop.\n\n\
         `rpf` here keeps the energy of fireflies, which its report loses. A ratio is that of the means over seeds; brackets \
         hold its 95 % interval by Student's t over seeds. A claim with an interval holds or fails if the whole interval \
         does and is undecided otherwise; the claims on P-RPF at 32 samples, interpolated pixels, speed-ups by upsampling, \
         weights, selections and stages rest on means. A claim holds from nine tenths of a lower figure (of the lower end of \
         a range) and up to ten ninths of an upper one; 1×, 1.1×, 1.25× and 0.00001 are exact, and stages may differ by a \
         tenth of the time. Ranges are over scenes. Times are those of the filter alone, except at equal time, where they \
         include sampling, in seconds per megapixel that is filtered.\n\n\
         References are sampled uniformly with {} samples per pixel and other seeds, and unfiltered. Errors are the mean of \
         (x − A)(x − B) with both halves A and B of the reference, which leaves the reference's own error out in the mean \
         over references; the noise of this one is common to all seeds and not in the intervals. Its own MSE is {} of \
         P-RPF's at {} samples per pixel and {} at equal time, where errors are the least certain. FLIP has no such form and \
         contains it.{left_out}",
        minutes(settings.base_spp),
        settings.base_spp,
        minutes(max_spp),
        settings.seeds,
        settings.margin,
        if margin_suffices { "as far" } else { "not as far" },
        settings.reference_spp,
        percent_of_prpf(REFERENCE, &at(PRPF, settings.base_spp)),
        settings.base_spp,
        percent_of_prpf(&at_equal_time(REFERENCE), &at_equal_time(PRPF)),
    )
}

/// Tabulates how many seeds and pixels each figure of RPF has.
fn runs_of_rpf(settings: &Settings, scenes: &[SceneResults], report: &mut Report) {
    report.paragraph(&format!(
        "Runs of RPF: seeds × pixels that are compared. Other interpretations of RPF have {} of the seeds, those of P-RPF \
         {}; the column at equal time gives the seeds of the other methods there, on RPF's pixels at {} samples per pixel.",
        settings.rpf_interpretation_seeds, settings.interpretation_seeds, settings.base_spp
    ));
    let mut head = vec!["scene".to_owned(), "σ₈²".to_owned()];
    head.extend(settings.spp.iter().map(|spp| format!("{spp} spp")));
    head.push("equal time".to_owned());
    let rows: Vec<Vec<String>> = scenes
        .iter()
        .map(|scene| {
            let entry = |&spp: &u32| match scene.rpf_runs.iter().find(|runs| runs.spp == spp) {
                Some(runs) => format!("{} × {}²", scene.seeds(&at(RPF, spp)), runs.side),
                None => "–".to_owned(),
            };
            let scene_settings = settings.scenes.iter().find(|settings| settings.name == scene.name);
            let sigma = scene_settings.map_or(f64::NAN, |settings| f64::from(settings.sigma8_squared));
            let mut row = vec![scene.name.clone(), number(sigma, 1)];
            row.extend(settings.spp.iter().map(entry));
            row.push(scene.seeds(&format!("{EQUAL_TIME} {PRPF}")).to_string());
            row
        })
        .collect();
    report.table(&head.iter().map(String::as_str).collect::<Vec<_>>(), &rows);
}

/// Plots time and error (the paper's Figs. 3 and 9).
fn plots(
    session: &Session,
    settings: &Settings,
    scenes: &[SceneResults],
    report: &mut Report,
) -> anyhow::Result<()> {
    let panels = |methods: &[&str], quantity: &dyn Fn(&SceneResults) -> String| -> Vec<Panel> {
        let series = |scene: &SceneResults| {
            let line = |&(method, name): &(&str, &str)| {
                let value = |spp| scene.get(&scene.compared_run(method, spp), &quantity(scene));
                let point = |&spp: &u32| (f64::from(spp), value(spp));
                let shown = settings.spp.iter().filter(|_| methods.contains(&method));
                Series::new(name, shown.map(point))
            };
            METHODS.iter().map(line).collect()
        };
        scenes.iter().map(|scene| Panel { title: scene.name.clone(), series: series(scene) }).collect()
    };
    let x = "samples per pixel";
    report.picture(
        "time.svg",
        "Filter time against samples per pixel (the paper's Fig. 3): where RPF ran, of all methods on its square of that count, \
         elsewhere on the crop.",
    );
    let times = panels(&[RPF, PRPF, NLM], &|_| "seconds".to_owned());
    Plot { x, y: "seconds per megapixel", panels: times, slope: false, columns: COLUMNS }
        .write(&session.out.join("time.svg"))?;
    report.picture(
        "mse.svg",
        "MSE against samples per pixel (the paper's Fig. 9), on the pixels that all counts of RPF share; grey: slope −1, plain \
         Monte Carlo.",
    );
    let errors = panels(&[UNFILTERED, RPF, PRPF, NLM], &|scene| mse_of_side(scene.shared_rpf_side()));
    Plot { x, y: "MSE", panels: errors, slope: true, columns: COLUMNS }.write(&session.out.join("mse.svg"))
}

/// Shows crops with their errors (the paper's Figs. 1, 2, 7 and 8).
fn equal_time(settings: &Settings, scenes: &[SceneResults], report: &mut Report) {
    report.section("Equal time");
    report.paragraph(&format!(
        "Each method on RPF's pixels in the time, sampling included, that RPF takes with {} samples per pixel, and with at most \
         {} samples per pixel: samples per pixel, relMSE, FLIP, and the measured time over RPF's (means over the seeds of each, \
         as above). A claim at equal time is undecided unless P-RPF's time is 0.9 to 1.1 of RPF's. Pictures are of seed 0.",
        settings.base_spp, settings.max_equal_time_spp
    ));
    let shown = [UNFILTERED, RPF, PRPF, NLM];
    let mut rows = Vec::new();
    for scene in scenes.iter().filter(|scene| scene.at(RPF, settings.base_spp, "mse").is_finite()) {
        let image = |name: &str| format!("<img src=\"{PICTURES}/{}-{name}.png\" width=\"192\">", scene.name);
        let mut images = vec![scene.name.clone()];
        images.extend(shown.iter().map(|method| image(method)));
        images.push(image("reference"));
        rows.push(images);
        let mut errors = vec![String::new()];
        errors.extend(shown.iter().map(|&method| {
            let run = if method == RPF {
                format!("{RPF} {}", settings.base_spp)
            } else {
                format!("{EQUAL_TIME} {method}")
            };
            let [spp, relmse, flip] = ["spp", "relmse", "flip"].map(|quantity| scene.get(&run, quantity));
            let time = scene.get(&run, TIME_OVER_RPF);
            let time = if method == RPF { String::new() } else { format!(", {}×", number(time, 2)) };
            format!("{} spp, {}, {}{time}", number(spp, 1), number(relmse, 2), number(flip, 2))
        }));
        errors.push(format!(
            "{} spp, {}",
            settings.reference_spp,
            number(scene.get(&format!("{EQUAL_TIME} {REFERENCE}"), "relmse"), 2)
        ));
        rows.push(errors);
    }
    let head = ["", "unfiltered", "RPF", "P-RPF", "`nlm`", "reference (its expected relMSE)"];
    report.table(&head, &rows);
}

/// Shows feature weights (the paper's Figs. 5 and 6).
fn weights(settings: &Settings, scenes: &[SceneResults], report: &mut Report) {
    let shown: Vec<&SceneResults> = scenes
        .iter()
        .filter(|scene| {
            settings
                .scenes
                .iter()
                .any(|scene_settings| scene_settings.name == scene.name && scene_settings.weight_maps)
        })
        .collect();
    if shown.is_empty() {
        return;
    }
    report.section("Feature weights");
    report.paragraph(&format!(
        "Weights of the first pass at {} samples per pixel, from left to right {}; dark is 0, yellow the maximum of those by \
         pixels. The paper's Fig. 6 compares interpolated weights with weights computed at every pixel, its Fig. 5 \
         neighbourhoods of pixels with those of samples (RPF's).",
        settings.base_spp,
        GROUPS.map(|(name, _)| name).join(", ")
    ));
    let rows: Vec<Vec<String>> = shown
        .iter()
        .map(|scene| {
            let image = |computation: &str| {
                format!(
                    "<img src=\"{PICTURES}/{}-weights-{}.png\" width=\"420\">",
                    scene.name,
                    computation.replace(' ', "-")
                )
            };
            std::iter::once(scene.name.clone()).chain(COMPUTATIONS.map(image)).collect()
        })
        .collect();
    report.table(&["", COMPUTATIONS[0], COMPUTATIONS[1], COMPUTATIONS[2]], &rows);
}

fn other_interpretations(settings: &Settings, scenes: &[SceneResults], report: &mut Report) {
    report.section("Other interpretations of the papers");
    report.paragraph(&format!(
        "Other interpretations of what the papers leave open, Eq. 4 of P-RPF to the letter among them: ratio of MSE to that of \
         the method in this report, at {} samples per pixel, with its interval where several seeds were run. Below 1 the \
         other interpretation is better.",
        settings.base_spp
    ));
    let mut head = vec!["interpretation"];
    head.extend(scenes.iter().map(|scene| scene.name.as_str()));
    let rows: Vec<Vec<String>> =
        interpretations(settings.scenes.first().map_or(0.0, |scene| scene.sigma8_squared))
            .into_iter()
            .map(|(name, _)| {
                let base = if name.starts_with("P-RPF") { PRPF } else { RPF };
                let ratio = |scene: &SceneResults| {
                    scene.ratio(&format!("{INTERPRETATION} {name}"), &at(base, settings.base_spp), "mse")
                };
                std::iter::once(name.to_owned())
                    .chain(scenes.iter().map(|s| with_interval(ratio(s), 3)))
                    .collect()
            })
            .collect();
    report.table(&head, &rows);
}

/// Tabulates the values that the claims are tested on.
fn tables(settings: &Settings, scenes: &[SceneResults], report: &mut Report) {
    report.section("Time and error by scene");
    time_and_error(settings, scenes, report);
    report.section("Whole images, and upsampling");
    report.paragraph(&format!(
        "P-RPF and `nlm` on whole images (at {} samples per pixel; 0 leaves them out): seconds per image, the fractions of P-RPF's time in \
         neighbourhoods, weights and filter, and the gain of upsampling on the crops.",
        settings.whole_spp
    ));
    upsampling(scenes, report);
}

fn time_and_error(settings: &Settings, scenes: &[SceneResults], report: &mut Report) {
    report.paragraph(
        "Times are in seconds per megapixel. Where RPF ran with that count, times and MSEs of all methods are means over its \
         pixels and seeds, elsewhere over the crop; MSEs have half their 95 % interval. Squares differ between sample counts: \
         compare within a row.",
    );
    let mut rows = Vec::new();
    for scene in scenes {
        for &spp in &settings.spp {
            let run = |method: &str| scene.compared_run(method, spp);
            let square = scene.rpf_runs.iter().find(|runs| runs.spp == spp);
            let pixels = square.map_or("crop".to_owned(), |runs| format!("{}²", runs.side));
            let mut row = vec![scene.name.clone(), spp.to_string(), pixels];
            for (method, _) in &METHODS[1..] {
                row.push(number(scene.get(&run(method), "seconds"), 3));
            }
            row.push(with_interval(scene.speed_up(PRPF, spp), 3));
            row.push(scene.seeds(&run(PRPF)).to_string());
            for (method, _) in &METHODS {
                row.push(plus_minus(scene.interval(&run(method), "mse")));
            }
            row.push(with_interval(scene.mse_over_rpf(PRPF, spp), 3));
            rows.push(row);
        }
    }
    let head = [
        "scene",
        "spp",
        "pixels",
        "RPF, s",
        "P-RPF, s",
        "`nlm`, s",
        "RPF ∕ P-RPF",
        "seeds",
        "MSE unfiltered",
        "RPF",
        "P-RPF",
        "`nlm`",
        "P-RPF ∕ RPF",
    ];
    report.table(&head, &rows);
}

/// Formats a mean and half its interval: `0.012 ± 0.001`.
fn plus_minus(interval: Interval) -> String {
    let half = 0.5 * (interval.high - interval.low);
    let mean = number(interval.mean, 3);
    if half.is_finite() { format!("{mean} ± {}", number(half, 2)) } else { mean }
}

fn upsampling(scenes: &[SceneResults], report: &mut Report) {
    let row = |scene: &SceneResults| {
        let whole = |quantity: &str| scene.get(WHOLE, quantity);
        let gain = |quantity: &str| {
            scene.get(UPSAMPLING, &format!("{quantity} without"))
                / scene.get(UPSAMPLING, &format!("{quantity} with"))
        };
        vec![
            scene.name.clone(),
            number(whole("seconds"), 3),
            number(whole("nlm seconds"), 3),
            STAGES.map(|stage| number(10.0 * whole(stage), 2)).join(" : "),
            format!("{} %", number(100.0 * whole("interpolated"), 3)),
            number(gain("weight seconds"), 2),
            number(gain("seconds"), 2),
            number(scene.get(UPSAMPLING, "weights mse"), 2),
            plus_minus(scene.interval(UPSAMPLING, "added mse")),
        ]
    };
    let head = [
        "scene",
        "P-RPF, s",
        "`nlm`, s",
        "stages",
        "interpolated",
        "speed-up of weights",
        "speed-up of the filter",
        "MSE of weights",
        "added MSE of the image",
    ];
    report.table(&head, &scenes.iter().map(row).collect::<Vec<_>>());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_shown_where_they_are_known() {
        let known = Interval { mean: 0.5, low: 0.4, high: 0.6 };
        let single = Interval { mean: 0.5, low: f64::NAN, high: f64::NAN };
        assert_eq!([plus_minus(known), plus_minus(single)], ["0.500 ± 0.10", "0.500"]);
        let formatted = [known, single].map(|interval| with_interval(interval, 3));
        assert_eq!(formatted, ["0.500 (0.400 to 0.600)", "0.500"]);
    }
}
