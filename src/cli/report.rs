//! The machine-readable account of a render.

use serde::Serialize;

use crate::progressive::{Batch, Forecast, Hurried, Outcome, Settings, StoppedBy, memory_bytes};
use crate::state::ImageMetadata;
use crate::stats::{Layout, Part, Store};

/// Where the time of the whole command went.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Times {
    pub load: f64,
    pub build: f64,
    pub render: f64,
    pub filter: f64,
    pub allocate: f64,
    pub write: f64,
    pub total: f64,
}

/// Fewest, mean and most samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    pub min: u32,
    pub mean: f64,
    pub max: u32,
}

impl Spread {
    pub fn of(store: &Store) -> Self {
        let counts = store.counts(Part::Whole);
        Self {
            min: counts.iter().copied().min().unwrap_or(0),
            mean: store.samples() as f64 / counts.len().max(1) as f64,
            max: counts.iter().copied().max().unwrap_or(0),
        }
    }
}

/// What each key means: `docs/outputs.md`.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    scene: &'a str,
    width: usize,
    height: usize,
    seed: u64,
    threads: usize,
    effects: &'a [String],
    dimensions: Vec<&'static str>,
    settings: &'a Settings,
    stopped_by: StoppedBy,
    seconds: Times,
    samples_total: u64,
    samples_min: u32,
    samples_max: u32,
    rejected_samples: u64,
    peak_memory_bytes: Option<u64>,
    /// Of samples that were kept whole.
    kept_samples_bytes: u64,
    estimated_error: Option<f64>,
    estimated_error_samples: Option<u64>,
    /// What the time sufficed for in place of the filter that was asked for.
    hurried: Option<Hurried>,
    /// How the error is expected to go on.
    forecast: Option<Forecast>,
    batches: &'a [Batch],
}

impl<'a> Report<'a> {
    pub fn of(metadata: &'a ImageMetadata, outcome: &'a Outcome, seconds: Times) -> Self {
        let Outcome { store, settings, .. } = outcome;
        let spread = Spread::of(store);
        Self {
            scene: &metadata.source,
            width: store.width(),
            height: store.height(),
            seed: settings.seed,
            threads: rayon::current_num_threads(),
            effects: &metadata.effects,
            dimensions: dimension_names(store.layout()),
            settings,
            stopped_by: outcome.stopped_by,
            seconds,
            samples_total: store.samples(),
            samples_min: spread.min,
            samples_max: spread.max,
            rejected_samples: store.rejected(),
            peak_memory_bytes: memory_bytes("VmHWM"),
            kept_samples_bytes: store.reservoir_bytes(),
            estimated_error: outcome.estimate.as_ref().map(|e| e.image),
            estimated_error_samples: outcome.estimate.as_ref().map(|e| e.samples),
            hurried: outcome.hurried,
            forecast: outcome.forecast(),
            batches: &outcome.batches,
        }
    }
}

/// Names of the alive dimensions of the sample vector.
pub(super) fn dimension_names(layout: &Layout) -> Vec<&'static str> {
    layout.dimensions().iter().map(|d| d.name).collect()
}
