//! Does a scene pay only for what it uses? One scene, its effects switched on one after another:
//! dimensions of the sample vector, pairs of mutual information, times, memory.

mod report;
mod variants;

use std::path::PathBuf;

use anyhow::Context;
use prpf::filter::{self, Quality};
use prpf::geometry::Accel;
use prpf::progressive::RESERVOIR;
use prpf::render::Renderer;
use prpf::scene::{Scene, pbrt};
use prpf::stats::{Group, Layout, Store};
use serde::Deserialize;

use crate::bench::Bench;
use crate::ledger::{Key, Values, values};
use crate::report::median;
use crate::{picture, sampling};

use variants::{Effect, Variant};

/// `effects.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    file: PathBuf,
    pixels: f64,
    spp: u32,
    repeats: usize,
    effect: Vec<Effect>,
}

/// What was measured of a variant.
struct Measured {
    variant: Variant,
    /// The effects that the scene calls for, as the library names them.
    called_for: Vec<&'static str>,
    values: Values,
}

/// Names of measured quantities.
mod quantity {
    pub const DIMENSIONS: &str = "dimensions";
    pub const RANDOM: &str = "random dimensions";
    pub const PAIRS: &str = "pairs";
    pub const RENDER: &str = "render seconds";
    pub const STANDARD: &str = "standard filter seconds";
    pub const PAPER: &str = "paper filter seconds";
    pub const STATISTICS: &str = "bytes per pixel of statistics";
    pub const SAMPLES: &str = "bytes per pixel of samples kept";
}

/// Seed of the samples.
const SEED: u64 = 0;
/// Picture of the scene with everything on.
const PICTURE: &str = "all.png";

pub fn run(bench: &mut Bench) -> anyhow::Result<()> {
    let settings: Settings = bench.settings()?;
    let text = std::fs::read_to_string(&settings.file)
        .with_context(|| format!("reading {}", settings.file.display()))?;
    let folder = settings.file.parent().context("a file is in a folder")?;
    let mut scenes = Vec::new();
    for variant in variants::variants(&text, &settings.effect)? {
        let mut scene = pbrt::read_str(&variant.text, folder)
            .with_context(|| format!("{} with {}", settings.file.display(), variant.name))?;
        scale(&mut scene, settings.pixels);
        scenes.push((variant, scene));
    }
    let times = measure_times(bench, &settings, &scenes)?;
    let all: Vec<Measured> = scenes
        .into_iter()
        .zip(times)
        .map(|((variant, scene), mut values)| {
            let effects = scene.effects();
            values.extend(counts(&Layout::for_effects(&effects)));
            Measured { variant, called_for: effects.names(), values }
        })
        .collect();
    report::write(bench, &settings, &all)
}

fn scale(scene: &mut Scene, pixels: f64) {
    let (width, height) = (scene.film.width as f64, scene.film.height as f64);
    let scale = (pixels / (width * height)).sqrt();
    scene.resize_film((width * scale).round() as usize, (height * scale).round() as usize);
}

/// What follows from the layout alone.
fn counts(layout: &Layout) -> Values {
    let of =
        |chosen: fn(Group) -> bool| layout.dimensions().iter().filter(|d| chosen(d.group)).count() as f64;
    let random = of(|group| group == Group::Random);
    let positions = of(|group| group == Group::Position);
    let features = of(|group| matches!(group, Group::Feature(_)));
    let colours = of(|group| group == Group::Colour);
    let statistics = Store::bytes_per_pixel(layout, 0);
    values([
        (quantity::DIMENSIONS, random + positions + features + colours),
        (quantity::RANDOM, random),
        // Of colours with all others, and of features with positions and random parameters.
        (quantity::PAIRS, colours * (random + positions + features) + features * (random + positions)),
        (quantity::STATISTICS, statistics as f64),
        (quantity::SAMPLES, (Store::bytes_per_pixel(layout, RESERVOIR) - statistics) as f64),
    ])
}

/// Medians of the times of each scene. Scenes take turns, so that what else runs on the machine meets all of
/// them alike.
fn measure_times(
    bench: &mut Bench,
    settings: &Settings,
    scenes: &[(Variant, Scene)],
) -> anyhow::Result<Vec<Values>> {
    let mut found = vec![Vec::new(); scenes.len()];
    let picture = bench.out.join(PICTURE);
    for turn in 0..settings.repeats {
        for (i, ((variant, scene), found)) in scenes.iter().zip(&mut found).enumerate() {
            bench.doing(format!("{}, {} of {}", variant.name, turn + 1, settings.repeats));
            let (width, height) = (scene.film.width, scene.film.height);
            let what = format!("{} spp={} size={width}x{height} turn={turn}", variant.name, settings.spp);
            let shows = turn == 0 && i + 1 == scenes.len();
            let files: &[PathBuf] = if shows { std::slice::from_ref(&picture) } else { &[] };
            found.push(bench.ledger.measure(Key::new("effects", SEED, what), files, || {
                let (values, store) = times(scene, settings.spp);
                if shows {
                    let image = filter::filter(&store, Quality::Standard, SEED).image;
                    picture::write(&picture, &image, 0.0)?;
                }
                Ok(values)
            })?);
        }
    }
    let medians = |found: &Vec<Values>| -> Values {
        let names = [quantity::RENDER, quantity::STANDARD, quantity::PAPER];
        values(names.map(|name| (name, median(found.iter().map(|values| values[name])))))
    };
    Ok(found.iter().map(medians).collect())
}

fn times(scene: &Scene, spp: u32) -> (Values, Store) {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, SEED);
    let mut store = sampling::store(&renderer, RESERVOIR, SEED);
    let render = sampling::add(&renderer, &mut store, spp);
    let filter = |quality| sampling::timed(|| filter::filter(&store, quality, SEED)).1;
    let (standard, paper) = (filter(Quality::Standard), filter(Quality::Paper));
    let values =
        values([(quantity::RENDER, render), (quantity::STANDARD, standard), (quantity::PAPER, paper)]);
    (values, store)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{self, package_folder};

    #[test]
    fn a_full_sample_vector_has_all_pairs() {
        let counts = counts(&Layout::with_blocks(|_| true));
        // 27 dimensions: 2 positions, 3 colours, 15 features, 7 random parameters.
        assert_eq!((counts[quantity::DIMENSIONS], counts[quantity::RANDOM]), (27.0, 7.0));
        assert_eq!(counts[quantity::PAIRS], 3.0 * 24.0 + 15.0 * 9.0);
    }

    #[test]
    fn the_scene_calls_for_one_effect_after_another() {
        let settings: Settings = settings::read(&package_folder().join("effects.toml"), false).unwrap();
        let file = package_folder().parent().unwrap().join(&settings.file);
        let text = std::fs::read_to_string(&file).unwrap();
        let variants = variants::variants(&text, &settings.effect).unwrap();
        let effects: Vec<_> = variants
            .iter()
            .map(|v| pbrt::read_str(&v.text, file.parent().unwrap()).unwrap().effects().names())
            .collect();
        assert!(effects[0].is_empty(), "{effects:?}");
        assert!(effects.windows(2).all(|pair| pair[1].len() > pair[0].len()), "{effects:?}");
    }
}
