//! The image files of a render: pixels, layers and header attributes.

use std::fmt;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::layers::Layers;
use super::sample_counts::SampleCounts;
use crate::filter::{FilterResult, weights_of};
use crate::image::OutputFormat;
use crate::image::exr_file::{self, Attribute, Windows, attribute_names};
use crate::image::metrics::Pair;
use crate::image::tone::to_srgb8;
use crate::image::{ImageError, Planes, png_file};
use crate::progressive::{ErrorEstimate, Outcome, PassRecord, Settings};
use crate::state::ImageMetadata;
use crate::stats::Store;

/// Name of the attribute, and of the text in a PNG, that holds the camera's directives.
const CAMERA: &str = "prpf.camera";

/// An image to be written, and what its attributes say of it.
#[derive(Clone, Copy)]
pub struct ImageOutput<'a> {
    pub result: &'a FilterResult,
    /// Side of the squares that were filtered, in pixels: 1 for pixels.
    pub side: usize,
    pub store: &'a Store,
    pub estimate: Option<&'a ErrorEstimate>,
    pub passes: &'a [PassRecord],
    pub metadata: &'a ImageMetadata,
    pub settings: &'a Settings,
    /// With it the attribute `MSE` is written: 3 planes.
    pub reference: Option<&'a Planes>,
    /// Seconds since the program's start.
    pub seconds: f64,
    /// The command that made it; empty if there was none.
    pub command_line: &'a str,
    /// Names of the layers beside the image; `None` for all.
    pub layers: Option<&'a [String]>,
}

/// Images that could not be written: all errors in one line.
#[derive(Debug)]
pub struct WriteErrors(Vec<ImageError>);

impl fmt::Display for WriteErrors {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let messages: Vec<String> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&messages.join("; "))
    }
}

impl std::error::Error for WriteErrors {}

impl<'a> ImageOutput<'a> {
    /// The image of a finished render, with all layers.
    pub fn new(outcome: &'a Outcome, metadata: &'a ImageMetadata) -> Self {
        Self {
            result: &outcome.result,
            side: outcome.side,
            store: &outcome.store,
            estimate: outcome.estimate.as_ref(),
            passes: &outcome.passes,
            metadata,
            settings: &outcome.settings,
            reference: None,
            seconds: outcome.passes.last().map_or(0.0, |pass| pass.seconds),
            command_line: "",
            layers: None,
        }
    }

    /// The image of a render that goes on, with all layers.
    pub fn interim(
        result: &'a FilterResult,
        store: &'a Store,
        settings: &'a Settings,
        metadata: &'a ImageMetadata,
    ) -> Self {
        Self {
            result,
            side: 1,
            store,
            estimate: None,
            passes: &[],
            metadata,
            settings,
            reference: None,
            seconds: 0.0,
            command_line: "",
            layers: None,
        }
    }

    /// Writes an image file, EXR or PNG by its extension.
    ///
    /// # Errors
    /// Those of the file system, and an extension of another format.
    pub fn write(&self, path: &Path) -> Result<(), ImageError> {
        match OutputFormat::from_path(path)? {
            OutputFormat::Png => {
                let texts = [(CAMERA, &*self.metadata.camera)];
                png_file::write_with_texts(path, &self.result.image, &texts)
            }
            OutputFormat::Exr => {
                let windows = Windows::in_film(self.metadata.pixel_bounds, self.metadata.film);
                exr_file::write(path, windows, &self.select_layers().channels(), &self.attributes())
            }
        }
    }

    /// Writes several image files. An error of one, such as a full disk, does not keep the others from being written.
    ///
    /// # Errors
    /// Those of all files.
    pub fn write_all(&self, paths: &[PathBuf]) -> Result<(), WriteErrors> {
        let errors: Vec<ImageError> = paths.par_iter().filter_map(|path| self.write(path).err()).collect();
        if errors.is_empty() { Ok(()) } else { Err(WriteErrors(errors)) }
    }

    /// Encodes an image file and discards it: to measure how long that takes.
    pub fn encode_and_discard(&self, path: &Path) {
        let image = &self.result.image;
        // An error will occur again, and be reported, when the file is written.
        match OutputFormat::from_path(path) {
            Ok(OutputFormat::Exr) => {
                let windows = Windows::whole(image.width(), image.height());
                let _ = exr_file::encode(windows, &self.select_layers().channels(), &[]);
            }
            Ok(OutputFormat::Png) => {
                let _ = png_file::encode(image.width(), image.height(), &to_srgb8(image, 0.0));
            }
            Err(_) => {}
        }
    }

    fn select_layers(&self) -> Layers {
        Layers::new(self.result, self.store, self.estimate, self.metadata, self.layers)
    }

    fn attributes(&self) -> Vec<(String, Attribute)> {
        let counts = SampleCounts::new(self.store);
        let own = |name: &str| format!("prpf.{name}");
        let schedule = self.passes.iter().map(|pass| pass.samples_total.try_into().unwrap_or(i64::MAX));
        let mut attributes = vec![
            (attribute_names::SAMPLES_PER_PIXEL.to_owned(), Attribute::Int(counts.mean.round() as i32)),
            (attribute_names::RENDER_TIME_SECONDS.to_owned(), Attribute::Float(self.seconds as f32)),
            (own("seed"), Attribute::Text(self.settings.seed.to_string())),
            (own("version"), Attribute::Text(env!("CARGO_PKG_VERSION").to_owned())),
            (own("commandLine"), Attribute::Text(self.command_line.to_owned())),
            (own("scene"), Attribute::Text(self.metadata.source.clone())),
            (own("sceneHash"), Attribute::Text(format!("sha256:{}", self.metadata.hash))),
            (CAMERA.to_owned(), Attribute::Text(self.metadata.camera.clone())),
            (own("denoiser"), Attribute::Text(self.result.made_by.to_string())),
            (own("samplesMin"), Attribute::Int(counts.min.try_into().unwrap_or(i32::MAX))),
            (own("samplesMean"), Attribute::Float(counts.mean as f32)),
            (own("samplesMax"), Attribute::Int(counts.max.try_into().unwrap_or(i32::MAX))),
            (own("batches"), Attribute::Ints(schedule.collect())),
        ];
        if self.side > 1 {
            attributes.push((own("squareSide"), Attribute::Int(self.side as i32)));
        }
        if let Some(weights) = weights_of(self.result.made_by) {
            attributes.push((own("weights"), Attribute::Text(weights.to_owned())));
        }
        let mse =
            self.reference.and_then(|reference| Some(Pair::new(&self.result.image, reference).ok()?.mse()));
        if let Some(mse) = mse {
            attributes.push((attribute_names::MSE.to_owned(), Attribute::Float(mse as f32)));
        }
        attributes
    }
}
