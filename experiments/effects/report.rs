//! Writes the report of `effects` from its measurements.

use super::settings::Settings;
use super::variant_results::{PICTURE, SEED, VariantResults, quantity};
use crate::report::{Report, number};
use crate::session::Session;

/// Writes `report.md`.
pub fn write(session: &Session, settings: &Settings, all: &[VariantResults]) -> anyhow::Result<()> {
    let mut report = Report::new("Does a scene pay only for the effects that it uses?", &finding(all));
    report.section("Costs of the effects");
    report.paragraph(&format!(
        "Each row adds an effect to those of the rows above it. {} samples per pixel; times are in seconds per million \
         pixels (median of {} turns; in brackets the ratio to the first row). Dimensions are those of the sample vector: \
         film position, colour, features, random parameters. *Pairs* are those of mutual information, which only `prpf` computes. \
         Memory is that of the statistics, and of the reservoir of {} sample vectors that only `prpf` needs.",
        settings.spp,
        settings.repeats,
        prpf::filter::prpf::RESERVOIR
    ));
    let head = [
        "effects",
        "dimensions",
        "random",
        "pairs",
        "render",
        "filter, nlm",
        "filter, prpf",
        "bytes per pixel",
        "of the reservoir",
    ];
    report.table(&head, &all.iter().map(|m| row(settings, &all[0], m)).collect::<Vec<_>>());
    report.section("Effects by variant");
    let effects = |m: &VariantResults| vec![m.variant.name.clone(), m.effects.join(", ")];
    report.table(&["effects", "names in `prpf info`"], &all.iter().map(effects).collect::<Vec<_>>());
    report.picture(PICTURE, "The scene with all effects, filtered.");
    report.write(session, &SEED.to_string())
}

fn finding(all: &[VariantResults]) -> String {
    let (Some(first), Some(last)) = (all.first(), all.last()) else { return String::new() };
    let growth = |name: &str| number(last.values[name] / first.values[name], 2);
    let count = |m: &VariantResults, name: &str| format!("{:.0}", m.values[name]);
    format!(
        "**Without effects, the scene's sample vector has {} dimensions, {} of them random, and {} pairs of mutual \
         information; with all effects {}, {} and {}.** With all effects rendering takes {} times as long, `nlm` {} times, \
         `prpf` {} times, and the statistics of a pixel are {} times as large. The most expensive effect for \
         rendering is {}.",
        count(first, quantity::DIMENSIONS),
        count(first, quantity::RANDOM),
        count(first, quantity::PAIRS),
        count(last, quantity::DIMENSIONS),
        count(last, quantity::RANDOM),
        count(last, quantity::PAIRS),
        growth(quantity::RENDER),
        growth(quantity::NLM),
        growth(quantity::PRPF),
        growth(quantity::STATISTICS),
        most_expensive(all, quantity::RENDER),
    )
}

/// The effect that raises a quantity by the largest factor, and that factor.
fn most_expensive(all: &[VariantResults], name: &str) -> String {
    let steps = all.windows(2).map(|pair| {
        (pair[1].variant.name.trim_start_matches("+ "), pair[1].values[name] / pair[0].values[name])
    });
    let largest = steps.max_by(|a, b| a.1.total_cmp(&b.1));
    largest.map_or(String::new(), |(effect, factor)| format!("{effect} (×{})", number(factor, 3)))
}

fn row(settings: &Settings, first: &VariantResults, m: &VariantResults) -> Vec<String> {
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
        time(quantity::NLM),
        time(quantity::PRPF),
        count(quantity::STATISTICS),
        count(quantity::RESERVOIR),
    ]
}
