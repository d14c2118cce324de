//! The state file of the command line: `--state`, `--resume`, `--state-every`.

use std::path::Path;

use anyhow::Context;

use super::failure::Failure;
use super::state_options::StateOptions;
use super::terminal::{escaped, print_error};
use crate::progressive::{Checkpoint, Settings};
use crate::render::Renderer;
use crate::state::{Checkpoints, ImageMetadata, RenderState};
use crate::stats::BlockSet;

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
    // An empty file is a reserved name
    let has_content =
        |path: &&Path| std::fs::metadata(path).is_ok_and(|file| file.len() > 0 || !file.is_file());
    let Some(path) = options.state.as_deref().filter(|_| options.resume).filter(has_content) else {
        return Ok(None);
    };
    let state = RenderState::read(path)?;
    warn_of_weights(path, &state);
    let stream = options.stream(settings.seed);
    state
        .can_resume(metadata, stream, &renderer.layout_of(BlockSet::ALL), settings, asked)
        .with_context(|| path.display().to_string())?;
    Ok(Some(state.checkpoint))
}

/// Warns if the weights in use are not those by which a state's render filtered.
pub(super) fn warn_of_weights(path: &Path, state: &RenderState) {
    if let Some(difference) = state.other_weights() {
        print_error(&escaped(&format!("warning: {}: {difference}", path.display())));
    }
}

/// Begins to write checkpoints, if the options name a file.
///
/// # Errors
/// The file cannot be written, or is in use.
pub(super) fn begin(
    options: &StateOptions,
    metadata: &ImageMetadata,
    renderer: &Renderer,
    settings: &Settings,
) -> anyhow::Result<Option<Checkpoints>> {
    let Some(path) = &options.state else { return Ok(None) };
    let stream = options.stream(settings.seed);
    Ok(Some(Checkpoints::begin(path, options.state_every, metadata, stream, renderer, settings)?))
}

/// Waits until the latest checkpoint is written, and ends.
///
/// # Errors
/// Why it could not be written.
pub(super) fn finish(checkpoints: Option<Checkpoints>) -> Result<(), Failure> {
    checkpoints.map_or(Ok(()), |checkpoints| checkpoints.wait()).map_err(|error| Failure::Run(error.into()))
}
