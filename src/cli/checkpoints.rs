//! Checkpoints of a render in its state file.

use std::path::{Path, PathBuf};

use anyhow::Context;

use super::failure::Failure;
use super::state_options::StateOptions;
use super::terminal::print_error;
use crate::progressive::{Checkpoint, Settings};
use crate::render::Renderer;
use crate::state::{self, CheckpointWriter, ImageMetadata, RenderState, Stream};
use crate::stats::{BlockSet, Store};

/// Writes checkpoints while the render goes on.
pub(super) struct Checkpoints {
    /// Seconds between two.
    pub interval: f64,
    path: PathBuf,
    writer: CheckpointWriter,
    /// Whether the latest write failed.
    has_failed: bool,
    metadata: ImageMetadata,
    stream: Stream,
}

/// Reads the checkpoint from which a render is to go on, if there is one. `asked`: the blocks of dimensions that the options ask for.
///
/// # Errors
/// A file that is no state, or that of another render.
pub(super) fn read(
    options: &StateOptions,
    metadata: &ImageMetadata,
    renderer: &Renderer,
    settings: &Settings,
    asked: BlockSet,
) -> anyhow::Result<Option<Checkpoint>> {
    let Some(path) = options.state.as_deref().filter(|path| options.resume && path.exists()) else {
        return Ok(None);
    };
    let state = RenderState::read(path)?;
    let stream = options.stream(settings.seed);
    state
        .can_resume(metadata, stream, &renderer.layout_of(BlockSet::ALL), settings, asked)
        .with_context(|| path.display().to_string())?;
    Ok(Some(state.checkpoint))
}

fn unwritable(path: &Path) -> String {
    format!("{}: cannot write the state", path.display())
}

impl Checkpoints {
    /// Begins to write checkpoints, if the options name a file.
    ///
    /// # Errors
    /// The file cannot be written, or is in use.
    pub fn begin(
        options: &StateOptions,
        metadata: &ImageMetadata,
        renderer: &Renderer,
        settings: &Settings,
    ) -> anyhow::Result<Option<Self>> {
        let Some(path) = &options.state else { return Ok(None) };
        let (width, height) = renderer.resolution();
        let size = state::estimate_size(renderer.layout(), settings.reservoir_capacity(), width * height);
        let writer =
            CheckpointWriter::new(path, size.unwrap_or(usize::MAX)).with_context(|| unwritable(path))?;
        Ok(Some(Self {
            interval: options.state_every,
            path: path.clone(),
            writer,
            has_failed: false,
            metadata: metadata.clone(),
            stream: options.stream(settings.seed),
        }))
    }

    /// Writes a checkpoint in the background. The render goes on even if the disk is full: there is still an image to
    /// come, and space may be freed.
    pub fn save(&self, settings: &Settings, checkpoint: Checkpoint) {
        self.writer.write(&self.state(settings, self.metadata.clone(), checkpoint));
    }

    /// Returns what has gone wrong since the last call, once for as long as it lasts; it is printed as well.
    pub fn problem(&mut self) -> Option<String> {
        let result = self.writer.new_result()?;
        let is_new = !std::mem::replace(&mut self.has_failed, result.is_err());
        let problem = format!("{}: {}", unwritable(&self.path), result.err().filter(|_| is_new)?);
        print_error(&format!("warning: {problem}; the render goes on"));
        Some(problem)
    }

    /// Waits until the latest checkpoint is written.
    ///
    /// # Errors
    /// One line: why it could not be written.
    pub fn wait(&self) -> Result<(), String> {
        self.writer.wait().map_err(|error| format!("{}: {error}", unwritable(&self.path)))
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

    /// Waits until the latest checkpoint is written, and ends.
    pub fn finish(self) -> Result<(), Failure> {
        self.writer
            .finish()
            .map_err(anyhow::Error::msg)
            .with_context(|| unwritable(&self.path))
            .map_err(Failure::Run)
    }

    fn state(&self, settings: &Settings, metadata: ImageMetadata, checkpoint: Checkpoint) -> RenderState {
        RenderState { metadata, settings: settings.clone(), streams: vec![self.stream], checkpoint }
    }
}
