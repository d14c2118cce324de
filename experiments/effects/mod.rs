//! The experiment `effects`: does a scene pay only for the effects that it uses?
//!
//! Switches on the effects of one scene one after another; measures the dimensions of the sample vector, the pairs
//! of mutual information, times and memory.

mod report;
mod settings;
mod variant_results;
mod variants;

use std::path::PathBuf;

use anyhow::Context;
use prpf::filter::prpf::PRPF;
use prpf::filter::prpf::RESERVOIR;
use prpf::filter::{Denoiser, nlm};
use prpf::geometry::Accel;
use prpf::render::{Renderer, sample_layout};
use prpf::scene::{Scene, pbrt};
use prpf::stats::{Group, Layout, Store};

use crate::ledger::{Key, Values, values};
use crate::report::median;
use crate::session::Session;
use crate::{picture, sampling};

use settings::Settings;
use variant_results::{PICTURE, SEED, VariantResults, quantity};
use variants::Variant;

/// Runs the experiment.
pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let settings: Settings = session.settings()?;
    let text = std::fs::read_to_string(&settings.file)
        .with_context(|| format!("cannot read {}", settings.file.display()))?;
    let folder = settings.file.parent().context("a file is in a folder")?;
    let mut scenes = Vec::new();
    for variant in variants::variants(&text, &settings.effect)? {
        let mut scene = pbrt::read_str(&variant.text, folder)
            .with_context(|| format!("{} with {}", settings.file.display(), variant.name))?;
        scale(&mut scene, settings.pixels);
        scenes.push((variant, scene));
    }
    let times = measure_times(session, &settings, &scenes)?;
    let all: Vec<VariantResults> = scenes
        .into_iter()
        .zip(times)
        .map(|((variant, scene), mut values)| {
            let effects = scene.effects();
            values.extend(counts(&sample_layout(&effects)));
            VariantResults { variant, effects: effects.names(), values }
        })
        .collect();
    report::write(session, &settings, &all)
}

fn scale(scene: &mut Scene, pixels: f64) {
    let (width, height) = (scene.film.width as f64, scene.film.height as f64);
    let scale = (pixels / (width * height)).sqrt();
    scene.resize_film((width * scale).round() as usize, (height * scale).round() as usize);
}

/// The quantities that follow from the layout alone.
fn counts(layout: &Layout) -> Values {
    let count =
        |chosen: fn(Group) -> bool| layout.dimensions().iter().filter(|d| chosen(d.group)).count() as f64;
    let random = count(|group| group == Group::Random);
    let positions = count(|group| group == Group::Position);
    let features = count(|group| matches!(group, Group::Feature(_)));
    let colours = count(|group| group == Group::Colour);
    let statistics = Store::bytes_per_pixel(layout, 0);
    values([
        (quantity::DIMENSIONS, random + positions + features + colours),
        (quantity::RANDOM, random),
        // Colours with all others, and features with positions and random parameters
        (quantity::PAIRS, colours * (random + positions + features) + features * (random + positions)),
        (quantity::STATISTICS, statistics as f64),
        (quantity::RESERVOIR, (Store::bytes_per_pixel(layout, RESERVOIR) - statistics) as f64),
    ])
}

/// Measures the median times of each scene. Scenes take turns, so that other load of the machine affects all of
/// them alike.
fn measure_times(
    session: &mut Session,
    settings: &Settings,
    scenes: &[(Variant, Scene)],
) -> anyhow::Result<Vec<Values>> {
    let mut measured = vec![Vec::new(); scenes.len()];
    let picture = session.out.join(PICTURE);
    for turn in 0..settings.repeats {
        for (i, ((variant, scene), measured)) in scenes.iter().zip(&mut measured).enumerate() {
            session.show_status(format!("{}, {} of {}", variant.name, turn + 1, settings.repeats));
            let (width, height) = (scene.film.width, scene.film.height);
            let key = format!("{} spp={} size={width}x{height} turn={turn}", variant.name, settings.spp);
            let is_shown = turn == 0 && i + 1 == scenes.len();
            let files: &[PathBuf] = if is_shown { std::slice::from_ref(&picture) } else { &[] };
            measured.push(session.ledger.measure(Key::new("effects", SEED, key), files, || {
                let (values, store) = times(scene, settings.spp);
                if is_shown {
                    let image = nlm::STANDARD.filter(&store, SEED).image;
                    picture::write(&picture, &image, 0.0)?;
                }
                Ok(values)
            })?);
        }
    }
    let medians = |measured: &Vec<Values>| -> Values {
        let names = [quantity::RENDER, quantity::NLM, quantity::PRPF];
        values(names.map(|name| (name, median(measured.iter().map(|values| values[name])))))
    };
    Ok(measured.iter().map(medians).collect())
}

/// Renders the scene and filters the store once with each filter.
fn times(scene: &Scene, spp: u32) -> (Values, Store) {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, SEED);
    let mut store = sampling::store(&renderer, RESERVOIR, SEED);
    let render = sampling::add(&renderer, &mut store, spp);
    let filter = |denoiser: &dyn Denoiser| sampling::timed(|| denoiser.filter(&store, SEED)).1;
    let (nlm, prpf) = (filter(&nlm::STANDARD), filter(&PRPF));
    let values = values([(quantity::RENDER, render), (quantity::NLM, nlm), (quantity::PRPF, prpf)]);
    (values, store)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{package_folder, read};

    #[test]
    fn a_full_sample_vector_has_all_pairs() {
        let counts = counts(&Layout::with_blocks(|_| true));
        // 27 dimensions: 2 positions, 3 colours, 15 features, 7 random parameters.
        assert_eq!((counts[quantity::DIMENSIONS], counts[quantity::RANDOM]), (27.0, 7.0));
        assert_eq!(counts[quantity::PAIRS], 3.0 * 24.0 + 15.0 * 9.0);
    }

    #[test]
    fn each_variant_calls_for_more_effects() {
        let settings: Settings = read(&package_folder().join("effects.toml"), false).unwrap();
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
