//! The report of `effects`: all of its words that say more or less follow from numbers.

use super::{Measured, PICTURE, Settings, quantity};
use crate::bench::Bench;
use crate::report::{Report, number};

pub fn write(bench: &Bench, settings: &Settings, all: &[Measured]) -> anyhow::Result<()> {
    let mut report = Report::new("Does a scene pay only for what it uses?", &finding(all));
    report.section("One effect after another");
    report.paragraph(&format!(
        "Each row has the effects of the rows above it and one more, {} samples per pixel, times in seconds per million \
         pixels (median of {} turns; in brackets over the first row). Dimensions are those of the sample vector: film \
         position, colour, features, random parameters. Pairs are those of mutual information, which only `paper` \
         measures. Memory is that of the statistics, and of the {} whole samples that only `paper` keeps.",
        settings.spp,
        settings.repeats,
        prpf::progressive::RESERVOIR
    ));
    let head = [
        "effects",
        "dimensions",
        "random",
        "pairs",
        "render",
        "filter, standard",
        "filter, paper",
        "bytes per pixel",
        "of whole samples",
    ];
    report.table(&head, &all.iter().map(|m| row(settings, &all[0], m)).collect::<Vec<_>>());
    report.section("What the scene calls for");
    let called = |m: &Measured| vec![m.variant.name.clone(), m.called_for.join(", ")];
    report.table(&["effects", "as `prpf info` names them"], &all.iter().map(called).collect::<Vec<_>>());
    report.picture(PICTURE, "The scene with everything on, filtered.");
    report.write(bench, &super::SEED.to_string())
}

fn finding(all: &[Measured]) -> String {
    let (Some(first), Some(last)) = (all.first(), all.last()) else { return String::new() };
    let times = |name: &str| number(last.values[name] / first.values[name], 2);
    let count = |m: &Measured, name: &str| format!("{:.0}", m.values[name]);
    format!(
        "**With no effect on, the scene's sample vector has {} dimensions, {} of them random, and {} pairs of mutual \
         information; with all of them on {}, {} and {}.** On the way rendering gets {} times as expensive, `standard` {} \
         times, `paper` {} times, and the statistics of a pixel {} times as large. The dearest step is {} for rendering, {} \
         for `standard` and {} for `paper`.",
        count(first, quantity::DIMENSIONS),
        count(first, quantity::RANDOM),
        count(first, quantity::PAIRS),
        count(last, quantity::DIMENSIONS),
        count(last, quantity::RANDOM),
        count(last, quantity::PAIRS),
        times(quantity::RENDER),
        times(quantity::STANDARD),
        times(quantity::PAPER),
        times(quantity::STATISTICS),
        dearest(all, quantity::RENDER),
        dearest(all, quantity::STANDARD),
        dearest(all, quantity::PAPER),
    )
}

/// The effect whose coming raises a quantity by the largest factor, and that factor.
fn dearest(all: &[Measured], name: &str) -> String {
    let steps = all.windows(2).map(|pair| {
        (pair[1].variant.name.trim_start_matches("+ "), pair[1].values[name] / pair[0].values[name])
    });
    let most = steps.max_by(|a, b| a.1.total_cmp(&b.1));
    most.map_or(String::new(), |(effect, factor)| format!("{effect} (×{})", number(factor, 3)))
}

fn row(settings: &Settings, first: &Measured, m: &Measured) -> Vec<String> {
    let megapixels = settings.pixels / 1e6;
    let count = |name: &str| format!("{:.0}", m.values[name]);
    let time = |name: &str| {
        let relative = m.values[name] / first.values[name];
        format!("{} (×{})", number(m.values[name] / megapixels, 3), number(relative, 3))
    };
    vec![
        m.variant.name.clone(),
        count(quantity::DIMENSIONS),
        count(quantity::RANDOM),
        count(quantity::PAIRS),
        time(quantity::RENDER),
        time(quantity::STANDARD),
        time(quantity::PAPER),
        count(quantity::STATISTICS),
        count(quantity::SAMPLES),
    ]
}
