//! The report: the claims first, then plots, pictures and tables.

use prpf::filter::PrpfSettings;

use super::claims::{claims, finding};
use super::data::{EQUAL, Measured, PRPF, READING, REFERENCE, RPF, STANDARD, UNFILTERED, UPSAMPLING, WHOLE};
use super::measure::PICTURES;
use super::methods::{STAGES, readings};
use super::settings::Settings;
use super::weight_pictures::{SHOWN, WAYS};
use crate::bench::Bench;
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, number, range};

/// Methods as they are called in plots and tables.
const CALLED: [(&str, &str); 4] =
    [(UNFILTERED, "unfiltered"), (RPF, "RPF"), (PRPF, "P-RPF"), (STANDARD, "standard")];
const COLUMNS: usize = 3;

/// Writes report and plots.
///
/// # Errors
/// Files that cannot be written.
pub fn write(
    bench: &Bench,
    settings: &Settings,
    scenes: &[Measured],
    missing: &[String],
) -> anyhow::Result<()> {
    let claims = claims(scenes, settings);
    let mut report = Report::new("Do the paper's claims hold here?", &finding(&claims, scenes, settings));
    let head = [
        "claim",
        "paper",
        "here, its scenes",
        "here, our scenes",
        "`standard`",
        "holds",
        "why not, or why more",
    ];
    let rows = claims.iter().map(|claim| {
        let [theirs, ours] = claim.ours.clone();
        let cells = [claim.claim, claim.paper].map(str::to_owned).into_iter();
        cells.chain([theirs, ours, claim.standard.clone(), claim.verdict(), claim.why.clone()]).collect()
    });
    report.table(&head, &rows.collect::<Vec<Vec<String>>>());
    report.paragraph(&conditions(settings, scenes, missing));
    plots(bench, settings, scenes, &mut report)?;
    equal_time(settings, scenes, &mut report);
    weights(settings, scenes, &mut report);
    other_readings(settings, scenes, &mut report);
    tables(settings, scenes, &mut report);
    report.write(bench, &format!("{} (references: two others)", settings.seed))
}

/// What has to be known to read the table.
fn conditions(settings: &Settings, scenes: &[Measured], missing: &[String]) -> String {
    let own: Vec<f64> = scenes
        .iter()
        .map(|scene| scene.get(REFERENCE, "mse") / scene.at(RPF, settings.base_spp, "mse"))
        .collect();
    let left_out = if missing.is_empty() {
        String::new()
    } else {
        format!(" Not here, and so left out: {}.", missing.join(", "))
    };
    // By the time for a pixel of the crop.
    let minutes = |spp: u32| {
        range(
            scenes.iter().map(|scene| {
                let parts =
                    scene.get(REFERENCE, "pixels of the image") / scene.get(REFERENCE, "pixels of the part");
                scene.at(RPF, spp, "seconds") * parts / 60.0
            }),
            2,
        )
    };
    let reaches = PrpfSettings::paper().windows.iter().all(|window| window / 2 <= settings.margin);
    let most =
        scenes.iter().flat_map(|scene| scene.rpf_spp.iter().copied()).max().unwrap_or(settings.base_spp);
    format!(
        "RPF would take {} minutes for these images at {} samples per pixel and {} at {most}, so both methods run on the \
         same crop of each scene with {} pixels of margin ({} as the largest window reaches), and errors are those of the \
         crop without it; only what is said to be of whole images is. Times are of the filter alone, but at equal time, \
         where they include sampling. Ranges are over scenes; a claim that names a figure holds from nine tenths of it. \
         References are sampled uniformly with {} samples per pixel, other seeds, and unfiltered; their own MSE is {} of \
         RPF's at {} samples per pixel.{left_out}",
        minutes(settings.base_spp),
        settings.base_spp,
        minutes(most),
        settings.margin,
        if reaches { "as far" } else { "not as far" },
        settings.reference_spp,
        percent_range(&own),
        settings.base_spp,
    )
}

fn percent_range(shares: &[f64]) -> String {
    format!("{} %", range(shares.iter().map(|share| 100.0 * share), 2))
}

/// The paper's Figs. 3 and 9.
fn plots(bench: &Bench, settings: &Settings, scenes: &[Measured], report: &mut Report) -> anyhow::Result<()> {
    let panels = |methods: &[&str], quantity: &str| -> Vec<Panel> {
        let series = |scene: &Measured| {
            let line = |&(method, called): &(&str, &str)| {
                let point = |&spp: &u32| (f64::from(spp), scene.at(method, spp, quantity));
                let shown = settings.spp.iter().filter(|_| methods.contains(&method));
                Series::new(called, shown.map(point))
            };
            CALLED.iter().map(line).collect()
        };
        scenes.iter().map(|scene| Panel { title: scene.name.clone(), series: series(scene) }).collect()
    };
    let x = "samples per pixel";
    report.picture("time.svg", "Filter time against samples per pixel (the paper's Fig. 3).");
    let times = panels(&[RPF, PRPF, STANDARD], "seconds");
    Plot { x, y: "seconds in the filter", panels: times, slope: false, columns: COLUMNS }
        .write(&bench.out.join("time.svg"))?;
    report.picture(
        "mse.svg",
        "MSE against samples per pixel (its Fig. 9); grey: slope −1, as plain Monte Carlo has it.",
    );
    let errors = panels(&[UNFILTERED, RPF, PRPF, STANDARD], "mse");
    Plot { x, y: "MSE", panels: errors, slope: true, columns: COLUMNS }.write(&bench.out.join("mse.svg"))
}

/// Insets with their errors, as the paper's Figs. 1, 2, 7 and 8.
fn equal_time(settings: &Settings, scenes: &[Measured], report: &mut Report) {
    report.section("At the time of RPF");
    report.paragraph(&format!(
        "What each method makes of the time, sampling included, that RPF takes with {} samples per pixel (at most {} \
         samples per pixel): samples per pixel, relMSE, FLIP.",
        settings.base_spp, settings.most_equal_time_spp
    ));
    let shown = [UNFILTERED, RPF, PRPF, STANDARD];
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
                format!("{EQUAL} {method}")
            };
            let [spp, relmse, flip] = ["spp", "relmse", "flip"].map(|quantity| scene.get(&run, quantity));
            format!("{spp} spp, {}, {}", number(relmse, 2), number(flip, 2))
        }));
        errors.push(format!(
            "{} spp, ±{}",
            settings.reference_spp,
            number(scene.get(REFERENCE, "relmse"), 2)
        ));
        rows.push(errors);
    }
    let head = ["", "unfiltered", "RPF", "P-RPF", "`standard`", "reference (its own relMSE)"];
    report.table(&head, &rows);
}

/// The paper's Figs. 5 and 6.
fn weights(settings: &Settings, scenes: &[Measured], report: &mut Report) {
    let shown: Vec<&Measured> = scenes
        .iter()
        .filter(|scene| {
            settings.scenes.iter().any(|of_scene| of_scene.name == scene.name && of_scene.weight_pictures)
        })
        .collect();
    if shown.is_empty() {
        return;
    }
    report.section("Feature weights");
    report.paragraph(&format!(
        "Weights of the first pass at {} samples per pixel, from left to right {}; dark is 0, yellow the brightest of those by \
         pixels. Interpolated beside computed at every pixel is the paper's Fig. 6, from neighbourhoods of pixels beside \
         those of samples (RPF's) its Fig. 5.",
        settings.base_spp,
        SHOWN.map(|(name, _)| name).join(", ")
    ));
    let rows: Vec<Vec<String>> = shown
        .iter()
        .map(|scene| {
            let image = |way: &str| {
                format!(
                    "<img src=\"{PICTURES}/{}-weights-{}.png\" width=\"420\">",
                    scene.name,
                    way.replace(' ', "-")
                )
            };
            std::iter::once(scene.name.clone()).chain(WAYS.map(image)).collect()
        })
        .collect();
    report.table(&["", WAYS[0], WAYS[1], WAYS[2]], &rows);
}

fn other_readings(settings: &Settings, scenes: &[Measured], report: &mut Report) {
    report.section("Other readings of the papers");
    report.paragraph(&format!(
        "What the papers leave open, read otherwise: MSE as a multiple of that of the same method as published here, at {} \
         samples per pixel. Below 1 the other reading is better.",
        settings.base_spp
    ));
    let mut head = vec!["reading"];
    head.extend(scenes.iter().map(|scene| scene.name.as_str()));
    let rows: Vec<Vec<String>> = readings(settings.scenes.first().map_or(0.0, |scene| scene.sigma8_squared))
        .into_iter()
        .map(|(name, _)| {
            let base = if name.starts_with("P-RPF") { PRPF } else { RPF };
            let ratio = |scene: &Measured| {
                scene.get(&format!("{READING} {name}"), "mse") / scene.at(base, settings.base_spp, "mse")
            };
            std::iter::once(name.to_owned()).chain(scenes.iter().map(|s| number(ratio(s), 3))).collect()
        })
        .collect();
    report.table(&head, &rows);
}

/// All numbers that the claims are made from.
fn tables(settings: &Settings, scenes: &[Measured], report: &mut Report) {
    report.section("Time and error by scene");
    let mut rows = Vec::new();
    for scene in scenes {
        for &spp in &settings.spp {
            let mut row = vec![scene.name.clone(), spp.to_string()];
            for (method, _) in &CALLED[1..] {
                row.push(number(scene.at(method, spp, "seconds"), 3));
            }
            row.push(number(scene.speed_up(spp), 3));
            for (method, _) in &CALLED {
                row.push(number(scene.at(method, spp, "mse"), 3));
            }
            rows.push(row);
        }
    }
    let head = [
        "scene",
        "spp",
        "RPF, s",
        "P-RPF, s",
        "`standard`, s",
        "RPF ∕ P-RPF",
        "MSE unfiltered",
        "RPF",
        "P-RPF",
        "`standard`",
    ];
    report.table(&head, &rows);

    report.section("Whole images, and upsampling");
    report.paragraph(&format!(
        "P-RPF on whole images at {} samples per pixel, its time in neighbourhoods, weights and filter; and on the crops, what \
         upsampling of weights gains.",
        settings.whole_spp
    ));
    let rows: Vec<Vec<String>> = scenes
        .iter()
        .map(|scene| {
            let whole = |quantity: &str| scene.get(WHOLE, quantity);
            let gain = |what: &str| {
                scene.get(UPSAMPLING, &format!("{what} without"))
                    / scene.get(UPSAMPLING, &format!("{what} with"))
            };
            vec![
                scene.name.clone(),
                number(whole("seconds"), 3),
                number(whole("standard seconds"), 3),
                STAGES.map(|stage| number(10.0 * whole(stage), 2)).join(" : "),
                format!("{} %", number(100.0 * whole("interpolated"), 3)),
                number(gain("weight seconds"), 2),
                number(gain("seconds"), 2),
                number(scene.get(UPSAMPLING, "weights mse"), 2),
                number(scene.get(UPSAMPLING, "mse with") - scene.get(UPSAMPLING, "mse without"), 2),
            ]
        })
        .collect();
    let head = [
        "scene",
        "P-RPF, s",
        "`standard`, s",
        "stages",
        "interpolated",
        "weights faster",
        "all faster",
        "MSE of weights",
        "added MSE of image",
    ];
    report.table(&head, &rows);
}
