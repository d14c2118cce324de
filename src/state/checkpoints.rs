//! Writes the checkpoints of a render to its state file while the render goes on.
//!
//! Takes what [`Host`](crate::progressive::Host) hands over, on the command line and from Python; gives the errors of the file system.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::checkpoint_writer::CheckpointWriter;
use super::format::estimate_size;
use super::image_metadata::ImageMetadata;
use super::render_state::RenderState;
use super::stream::Stream;
use crate::files::error_message;
use crate::filter::weights_of;
use crate::progressive::{Checkpoint, Settings};
use crate::render::Renderer;
use crate::stats::Store;

/// Writes the checkpoints of one render to its state file while the render goes on. Dropping it waits for the latest one.
pub struct Checkpoints {
    /// Seconds between two.
    interval: f64,
    path: PathBuf,
    writer: CheckpointWriter,
    /// Whether the latest write failed.
    has_failed: bool,
    metadata: ImageMetadata,
    stream: Stream,
}

/// A state file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write the state: {}", path.display(), error_message(cause))]
pub struct CheckpointError {
    pub path: PathBuf,
    pub cause: Arc<io::Error>,
}

impl Checkpoints {
    /// Begins to write the checkpoints of the samples `stream` that `renderer` takes of an image, one every `interval` seconds.
    ///
    /// # Errors
    /// The file cannot be written, or is in use.
    pub fn begin(
        path: &Path,
        interval: f64,
        metadata: &ImageMetadata,
        stream: Stream,
        renderer: &Renderer,
        settings: &Settings,
    ) -> Result<Self, CheckpointError> {
        let (width, height) = renderer.resolution();
        let size = estimate_size(renderer.layout(), settings.reservoir_capacity(), width * height);
        let writer = CheckpointWriter::new(path, size.unwrap_or(usize::MAX))
            .map_err(|cause| CheckpointError { path: path.to_owned(), cause: Arc::new(cause) })?;
        let (path, metadata) = (path.to_owned(), metadata.clone());
        Ok(Self { interval, path, writer, has_failed: false, metadata, stream })
    }

    /// Returns the seconds between two checkpoints; infinity while one is being written, for which the render would wait.
    pub fn interval(&self) -> f64 {
        if self.writer.is_writing() { f64::INFINITY } else { self.interval }
    }

    /// Writes a checkpoint in the background. The render goes on even if the disk is full: there is still an image to
    /// come, and space may be freed.
    pub fn save(&self, settings: &Settings, checkpoint: Checkpoint) {
        self.writer.write(&self.state(settings, self.metadata.clone(), checkpoint));
    }

    /// Returns the error of the latest write, once for as long as writing fails; `None` if there is nothing new.
    pub fn problem(&mut self) -> Option<CheckpointError> {
        let result = self.writer.new_result()?;
        let is_new = !std::mem::replace(&mut self.has_failed, result.is_err());
        result.err().filter(|_| is_new).map(|cause| self.error(cause))
    }

    /// Waits until the latest checkpoint is written.
    ///
    /// # Errors
    /// Why it could not be written.
    pub fn wait(&self) -> Result<(), CheckpointError> {
        self.writer.wait().map_err(|cause| self.error(cause))
    }

    /// Writes a checkpoint of some rows of the image and discards it, to measure how long that takes.
    pub fn write_and_discard(&self, settings: &Settings, rows: &Store) {
        let (width, height) = (rows.width(), rows.height());
        let metadata = ImageMetadata {
            film: [width, height],
            pixel_bounds: [0, width, 0, height],
            ..self.metadata.clone()
        };
        let checkpoint = Checkpoint::new(rows.clone());
        // An error will occur again, and be reported, at the end.
        let _ = self.state(settings, metadata, checkpoint).write_and_discard(&self.path);
    }

    fn state(&self, settings: &Settings, metadata: ImageMetadata, checkpoint: Checkpoint) -> RenderState {
        let weights = weights_of(settings.denoiser.name()).map(str::to_owned);
        RenderState { metadata, settings: settings.clone(), weights, streams: vec![self.stream], checkpoint }
    }

    fn error(&self, cause: Arc<io::Error>) -> CheckpointError {
        CheckpointError { path: self.path.clone(), cause }
    }
}
