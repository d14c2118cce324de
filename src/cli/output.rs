//! What a command leaves behind: images and the report.

use std::path::Path;
use std::time::Instant;

use super::layers::Layers;
use super::report::{Report, Spread};
use crate::filter::Filtered;
use crate::image::exr_file::{self, Attribute, Windows, names};
use crate::image::formats::OutputFormat;
use crate::image::metrics::Pair;
use crate::image::tone::to_srgb8;
use crate::image::{self, Planes, atomic, png_file};
use crate::progressive::{Batch, Settings};
use crate::state::Frame;
use crate::stats::Store;

/// Writes to nowhere, to see how long it takes. What fails here will fail, and be said, at the end.
pub(super) fn encode(path: &Path, layers: &Layers, filtered: &Filtered) {
    let (width, height) = (filtered.image.width(), filtered.image.height());
    match OutputFormat::of(path) {
        Ok(OutputFormat::Exr) => {
            let _ = exr_file::encode(Windows::whole(width, height), &layers.channels(), &[]);
        }
        Ok(OutputFormat::Png) => {
            let _ = png_file::encode(width, height, &to_srgb8(&filtered.image, 0.0));
        }
        Err(_) => {}
    }
}

pub(super) fn write(
    path: &Path,
    layers: &Layers,
    written: &Written,
    frame: &Frame,
    settings: &Settings,
    reference: Option<&Planes>,
    start: Instant,
) -> Result<(), image::ImageError> {
    match OutputFormat::of(path)? {
        OutputFormat::Png => png_file::write(path, written.image, 0.0),
        OutputFormat::Exr => {
            let windows = Windows { data: frame.pixel_bounds, display: frame.film };
            let attributes = attributes(written, frame, settings, reference, start);
            exr_file::write(path, windows, &layers.channels(), &attributes)
        }
    }
}

/// What a written image's attributes tell of.
pub(super) struct Written<'a> {
    pub store: &'a Store,
    pub image: &'a Planes,
    pub batches: &'a [Batch],
}

fn attributes(
    written: &Written,
    frame: &Frame,
    settings: &Settings,
    reference: Option<&Planes>,
    start: Instant,
) -> Vec<(String, Attribute)> {
    let spread = Spread::of(written.store);
    let own = |name: &str| format!("prpf.{name}");
    let schedule = written.batches.iter().map(|b| b.samples_total.try_into().unwrap_or(i64::MAX)).collect();
    let mut attributes = vec![
        (names::SAMPLES_PER_PIXEL.to_owned(), Attribute::Int(spread.mean.round() as i32)),
        (names::RENDER_TIME_SECONDS.to_owned(), Attribute::Float(start.elapsed().as_secs_f32())),
        (own("seed"), Attribute::Text(settings.seed.to_string())),
        (own("version"), Attribute::Text(env!("CARGO_PKG_VERSION").to_owned())),
        (own("commandLine"), Attribute::Text(command_line())),
        (own("scene"), Attribute::Text(frame.source.clone())),
        (own("sceneHash"), Attribute::Text(format!("sha256:{}", frame.hash))),
        (own("samplesMin"), Attribute::Int(spread.min.try_into().unwrap_or(i32::MAX))),
        (own("samplesMean"), Attribute::Float(spread.mean as f32)),
        (own("samplesMax"), Attribute::Int(spread.max.try_into().unwrap_or(i32::MAX))),
        (own("batches"), Attribute::Ints(schedule)),
    ];
    if let Some(mse) = reference.and_then(|r| Some(Pair::new(written.image, r).ok()?.mse())) {
        attributes.push((names::MSE.to_owned(), Attribute::Float(mse as f32)));
    }
    attributes
}

fn command_line() -> String {
    let words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    words.join(" ")
}

pub(super) fn write_report(path: &Path, report: &Report) -> anyhow::Result<()> {
    let text = serde_json::to_vec_pretty(report)?;
    atomic::replace_file::<anyhow::Error>(path, |file| {
        use std::io::Write;
        file.write_all(&text)?;
        Ok(file.write_all(b"\n")?)
    })
}
