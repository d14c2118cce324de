//! Measures time and error of filter variants on the same store.

use anyhow::Context;
use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::stats::Store;
use serde::Deserialize;

use super::filter_variant::{FilterVariant, NlmChanges, PrpfChanges};
use crate::ledger::{Key, Values, values};
use crate::report::median;
use crate::sampling;
use crate::session::Session;
use crate::test_scene::TestScene;

/// Table `filters` of `accuracy.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    pub spp: u32,
    pub seeds: u64,
    /// Number of runs, of which a time is the median.
    pub repeats: usize,
    nlm: Vec<NlmChanges>,
    prpf: Vec<PrpfChanges>,
}

impl Settings {
    /// The variants to measure.
    pub fn variants(&self) -> Vec<FilterVariant> {
        FilterVariant::list(&self.nlm, &self.prpf)
    }
}

/// Cost and error of a variant on one scene.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Seconds per million pixels.
    pub seconds: f64,
    /// relMSE.
    pub error: f64,
}

/// Measures every variant on a scene: mean of the error over the seeds, median of the seconds.
pub fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    settings: &Settings,
) -> anyhow::Result<Vec<Cost>> {
    let (width, height) = (test_scene.reference.image.width(), test_scene.reference.image.height());
    let megapixels = (width * height) as f64 / 1e6;

    // Filter the store of each seed with each variant
    // Stores with different reservoirs hold the same samples.
    let mut rendered: Option<((u64, usize), Store)> = None;
    let variants = settings.variants();
    let mut measured = vec![Vec::new(); variants.len()];
    for seed in 0..settings.seeds {
        for (variant, measured) in variants.iter().zip(&mut measured) {
            let FilterVariant { name, reservoir, .. } = variant;
            session.show_status(format!("{}: filter {name}, seed {seed}", test_scene.name));
            let key = format!(
                "filter={name:?} spp={} repeats={} size={width}x{height} reference-spp={}",
                settings.spp, settings.repeats, test_scene.reference.spp
            );
            let values = session.ledger.measure(Key::new(&test_scene.name, seed, key), &[], || {
                if rendered.as_ref().is_none_or(|(key, _)| *key != (seed, *reservoir)) {
                    let renderer = Renderer::new(&test_scene.scene, accel, seed);
                    let mut store = sampling::store(&renderer, *reservoir, seed);
                    sampling::add(&renderer, &mut store, settings.spp);
                    rendered = Some(((seed, *reservoir), store));
                }
                let (_, store) = rendered.as_ref().context("a store was rendered")?;
                let (filtered, first) = sampling::timed(|| variant.filter(store, seed));
                let again = (1..settings.repeats).map(|_| sampling::timed(|| variant.filter(store, seed)).1);
                let seconds = median(std::iter::once(first).chain(again));
                let [relmse, ..] = test_scene.errors(&filtered.image);
                Ok(values([relmse, ("seconds", seconds)]))
            })?;
            measured.push(values);
        }
    }

    // Summarise over the seeds
    let cost = |measured: &Vec<Values>| Cost {
        seconds: median(measured.iter().map(|values| values["seconds"])) / megapixels,
        error: measured.iter().map(|values| values["relmse"]).sum::<f64>() / measured.len() as f64,
    };
    Ok(measured.iter().map(cost).collect())
}
