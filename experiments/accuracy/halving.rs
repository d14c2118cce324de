//! Compares the forecast price of half the error with the seconds that it took.

use std::collections::BTreeSet;

use super::scene_results::SceneResults;
use crate::configuration::{CONFIGURATIONS, DEFAULT};
use crate::curves::{Point, curve};
use crate::report::{Goal, Report, median, number, range};
use crate::statistics::{Crossing, crossing};
use crate::test_scene::groups;

/// A forecast within this factor of the truth is right: 30 %.
const TOLERANCE: f64 = 1.3;

/// Ratios of forecast to true seconds until the error is halved, by sample count and seed, where the curve of the
/// error, mean of the seeds, reaches half of it.
fn ratios(points: &[Point]) -> Vec<(u32, f64)> {
    let curve = curve(points, None, |point| point.seconds, |point| point.error);
    let counts: BTreeSet<u32> = points.iter().map(|point| point.spp).collect();
    let of_count = |(i, spp): (usize, u32)| {
        let (seconds, error) = curve[i];
        let Some(Crossing::At(end)) = crossing(&curve[i..], 0.5 * error) else { return Vec::new() };
        let forecasts =
            points.iter().filter(|point| point.spp == spp).filter_map(|point| point.halving_seconds);
        forecasts.map(|forecast| (spp, forecast / (end - seconds))).collect()
    };
    counts.into_iter().enumerate().flat_map(of_count).collect()
}

/// Images whose half error the curve does not reach.
#[derive(Default)]
struct NotHalved {
    images: usize,
    /// Those whose forecast is too short all the same, by more than [`TOLERANCE`].
    too_short: usize,
}

impl NotHalved {
    fn new(points: &[Point]) -> Self {
        let curve = curve(points, None, |point| point.seconds, |point| point.error);
        let counts: BTreeSet<u32> = points.iter().map(|point| point.spp).collect();
        let mut found = Self::default();
        // What follows the last image is not known at all
        for (i, spp) in counts.into_iter().enumerate().take(curve.len().saturating_sub(1)) {
            let (seconds, error) = curve[i];
            if matches!(crossing(&curve[i..], 0.5 * error), Some(Crossing::At(_))) {
                continue;
            }
            let least = curve.last().map_or(0.0, |last| last.0) - seconds;
            let of_count = points.iter().filter(|point| point.spp == spp);
            for forecast in of_count.filter_map(|point| point.halving_seconds) {
                found.images += 1;
                found.too_short += usize::from(forecast * TOLERANCE < least);
            }
        }
        found
    }
}

fn default_ratios(m: &SceneResults) -> Vec<(u32, f64)> {
    ratios(&m.curves.points[DEFAULT])
}

fn is_right(ratio: f64) -> bool {
    (1.0 / TOLERANCE..=TOLERANCE).contains(&ratio)
}

/// The finding, in a sentence.
pub fn finding(all: &[SceneResults]) -> String {
    let of_group = |(name, scenes): (&str, Vec<&SceneResults>)| {
        let ratios: Vec<f64> =
            scenes.iter().flat_map(|m| default_ratios(m)).map(|(_, ratio)| ratio).collect();
        let right = ratios.iter().filter(|&&ratio| is_right(ratio)).count();
        let others = scenes.iter().map(|m| NotHalved::new(&m.curves.points[DEFAULT]));
        let others = others.fold(NotHalved::default(), |sum, scene| NotHalved {
            images: sum.images + scene.images,
            too_short: sum.too_short + scene.too_short,
        });
        format!(
            "on {name} {} times the true ones in the median ({}), right within 30 % in {right} of {} images ({} scenes, whose seeds \
             share a curve); in {} more the error was not halved in the measured time, {} of them with forecasts that it would be",
            number(median(ratios.iter().copied()), 2),
            range(ratios.iter().copied(), 2),
            ratios.len(),
            scenes.len(),
            others.images,
            others.too_short,
        )
    };
    let parts: Vec<String> = groups(all, |m| m.is_public).into_iter().map(of_group).collect();
    format!("The program's forecasts of the seconds until half the error are {}.", parts.join("; "))
}

/// The goal, beside what was measured.
pub fn goal(all: &[SceneResults]) -> Goal {
    const FRACTION: f64 = 0.8;
    let ratios: Vec<f64> = all.iter().flat_map(default_ratios).map(|(_, ratio)| ratio).collect();
    let too_short: usize = all.iter().map(|m| NotHalved::new(&m.curves.points[DEFAULT]).too_short).sum();
    let right = ratios.iter().filter(|&&ratio| is_right(ratio)).count();
    let fraction = right as f64 / (ratios.len() + too_short) as f64;
    Goal {
        goal: format!("seconds until half the error right within 30 % in {:.0} %", 100.0 * FRACTION),
        measured: format!("{right} of {}", ratios.len() + too_short),
        is_met: fraction >= FRACTION,
    }
}

/// Writes the section.
pub fn write(report: &mut Report, all: &[SceneResults]) {
    report.section("Is the price of half the error right?");
    report.paragraph(&format!(
        "Seconds until the error is halved as the program forecasts them at the end of a render, over those after which the \
         curve of the true error (mean of the seeds, interpolated) has half its value, filter passes on the way included; {}; \
         median and range over the seeds, where the curve reaches so far.",
        CONFIGURATIONS[DEFAULT].name()
    ));
    let counts: BTreeSet<u32> = all.iter().flat_map(default_ratios).map(|(spp, _)| spp).collect();
    let row = |m: &SceneResults| {
        let ratios = default_ratios(m);
        let cell = |&at: &u32| {
            let chosen = || ratios.iter().filter(|(spp, _)| *spp == at).map(|(_, ratio)| *ratio);
            if chosen().next().is_none() {
                return "–".to_owned();
            }
            format!("{} ({})", number(median(chosen()), 2), range(chosen(), 2))
        };
        std::iter::once(m.scene.clone()).chain(counts.iter().map(cell)).collect::<Vec<_>>()
    };
    let names: Vec<String> = counts.iter().map(|spp| format!("{spp} spp")).collect();
    let head: Vec<&str> = std::iter::once("scene").chain(names.iter().map(String::as_str)).collect();
    report.table(&head, &all.iter().map(row).collect::<Vec<_>>());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forecasts_are_compared_with_the_seconds_that_half_the_error_took() {
        // Error 1/t: from 1 to 2 seconds it takes one second to halve, from 2 to 4 two; 4 is the last point.
        let with_error = |spp: u32, error: f64, forecast| {
            let seconds = f64::from(spp);
            Point { spp, seed: 0, seconds, error, trimmed: error, flip: error, halving_seconds: forecast }
        };
        let point = |spp: u32, forecast| with_error(spp, 1.0 / f64::from(spp), forecast);
        let found = ratios(&[point(1, Some(1.0)), point(2, Some(3.0)), point(4, Some(1.0))]);
        let [(1, first), (2, second)] = found[..] else { panic!("{found:?}") };
        assert!((first - 1.0).abs() < 1e-12 && (second - 1.5).abs() < 1e-12);
        assert!(is_right(first) && !is_right(second) && is_right(0.8) && !is_right(0.7));
        assert!(ratios(&[point(1, None), point(2, None)]).is_empty());
        // A firefly in the third image: what follows it counts, not what came before
        let errors = [(1, 1.0), (2, 0.2), (3, 0.5), (4, 0.25)];
        let found = ratios(&errors.map(|(spp, error)| with_error(spp, error, Some(1.0))));
        assert_eq!(found.last().map(|&(spp, ratio)| (spp, (1e6 * ratio).round())), Some((3, 1e6)));
    }

    #[test]
    fn forecasts_of_errors_that_do_not_come_are_too_short_or_open() {
        let point = |seconds: f64, error, forecast| Point {
            spp: seconds as u32,
            seed: 0,
            seconds,
            error,
            trimmed: error,
            flip: error,
            halving_seconds: Some(forecast),
        };
        // The first is halved in time. Of the others one was forecast to be halved after 2 seconds, and was not after 5
        let points =
            [point(1.0, 1.0, 1.0), point(2.0, 0.4, 2.0), point(4.0, 0.35, 3.0), point(7.0, 0.3, 9.0)];
        let NotHalved { images, too_short } = NotHalved::new(&points);
        assert_eq!((images, too_short), (2, 1));
    }
}
