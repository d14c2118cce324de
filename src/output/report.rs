//! The machine-readable report of a render.

use std::path::Path;

use serde::Serialize;

use super::sample_counts::SampleCounts;
use crate::files;
use crate::filter::{DenoiserName, weights_of};
use crate::memory::peak_bytes;
use crate::progressive::{
    ErrorEstimate, Forecast, Outcome, PassRecord, ProcessRecord, Seconds, Settings, StoppedBy,
};
use crate::state::ImageMetadata;

/// Seconds of the stages of a whole command.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Times {
    pub load: f64,
    pub build: f64,
    pub render: f64,
    pub filter: f64,
    pub calibrate: f64,
    pub allocate: f64,
    pub write: f64,
    pub total: f64,
}

impl Times {
    /// Completes the times of the loop's stages with those before and after it.
    pub fn new(load: f64, build: f64, stages: Seconds, write: f64, total: f64) -> Self {
        let Seconds { render, filter, calibrate, allocate } = stages;
        Self { load, build, render, filter, calibrate, allocate, write, total }
    }
}

/// Version of the report's format.
const VERSION: u32 = 2;

/// The report; `docs/outputs.md` lists its keys.
#[derive(Serialize)]
pub struct Report<'a> {
    /// Version of the report's format: increased when a key is renamed or removed.
    version: u32,
    scene: &'a str,
    width: usize,
    height: usize,
    seed: u64,
    threads: usize,
    /// The camera, as directives of a scene file.
    camera: &'a str,
    effects: &'a [String],
    dimensions: Vec<&'static str>,
    statistics: Vec<&'static str>,
    settings: &'a Settings,
    stopped_by: StoppedBy,
    /// The denoiser that made the image: keys `denoiser` and, where it has presets, `quality`.
    #[serde(flatten)]
    made_by: DenoiserName,
    /// The trained weights that it filtered by.
    #[serde(skip_serializing_if = "Option::is_none")]
    weights: Option<&'static str>,
    /// Whether it is another denoiser than the settings ask for.
    fallback: bool,
    square_side: usize,
    seconds: Times,
    samples_total: u64,
    samples_min: u32,
    samples_max: u32,
    rejected_samples: u64,
    /// The first of them: pixel of the rendered image and index, as `--debug-sample` takes them.
    first_rejected_sample: Option<[u64; 3]>,
    peak_memory_bytes: Option<u64>,
    reservoir_bytes: u64,
    estimated_error: Option<f64>,
    estimated_error_low: Option<f64>,
    estimated_error_high: Option<f64>,
    forecast: Option<Forecast>,
    batches: &'a [PassRecord],
    /// Of a render by several processes.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    processes: &'a [ProcessRecord],
}

impl<'a> Report<'a> {
    /// Collects the report of a finished render.
    pub fn new(metadata: &'a ImageMetadata, outcome: &'a Outcome, seconds: Times) -> Self {
        let Outcome { store, settings, estimate, .. } = outcome;
        let counts = SampleCounts::new(store);
        let interval = estimate.as_ref().map(ErrorEstimate::interval);
        Self {
            version: VERSION,
            scene: &metadata.source,
            width: store.width(),
            height: store.height(),
            seed: settings.seed,
            threads: rayon::current_num_threads(),
            camera: &metadata.camera,
            effects: &metadata.effects,
            dimensions: store.layout().enabled_names(),
            statistics: store.layout().names().collect(),
            settings,
            stopped_by: outcome.stopped_by,
            made_by: outcome.result.made_by,
            weights: weights_of(outcome.result.made_by),
            fallback: outcome.is_fallback(),
            square_side: outcome.side,
            seconds,
            samples_total: store.samples(),
            samples_min: counts.min,
            samples_max: counts.max,
            rejected_samples: store.rejected(),
            first_rejected_sample: outcome
                .first_rejected
                .map(|sample| [sample.x as u64, sample.y as u64, sample.index.into()]),
            peak_memory_bytes: peak_bytes(),
            reservoir_bytes: store.reservoir_bytes(),
            estimated_error: estimate.as_ref().map(|estimate| estimate.value),
            estimated_error_low: interval.map(|[low, _]| low),
            estimated_error_high: interval.map(|[_, high]| high),
            forecast: outcome.forecast(),
            batches: &outcome.passes,
            processes: &outcome.processes,
        }
    }

    /// Writes the report as JSON.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        let text = serde_json::to_vec_pretty(self)?;
        files::replace_file(path, |file| {
            use std::io::Write;
            file.write_all(&text)?;
            file.write_all(b"\n")
        })
    }
}
