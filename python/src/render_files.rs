//! The files of a render: image, state and sample vectors that it writes, and the state from which it goes on.

use std::io;
use std::path::{Path, PathBuf};

use prpf::RenderedImage;
use prpf::files::error_message;
use prpf::image::OutputFormat;
use prpf::output::ImageOutput;
use prpf::output::paths::{are_distinct, replaces_no_state, replaces_state};
use prpf::progressive::Settings;
use prpf::render::Renderer;
use prpf::scene;
use prpf::state::{Checkpoints, ImageMetadata, RenderState, SampleFile, Stream};
use prpf::stats::Layout;
use pyo3::prelude::*;

use crate::errors::{checkpoint_error, file_error, image_error, state_error, value_error};
use crate::paths::can_be_written;

/// The files of a render, each if it is asked for.
pub struct RenderFiles {
    output: Option<PathBuf>,
    state: Option<PathBuf>,
    /// Seconds from one state to the next.
    state_every: f64,
    resume: Option<PathBuf>,
    samples: Option<PathBuf>,
}

impl RenderFiles {
    /// Takes the paths, and checks that the files to write are different ones that can be written, and replace nothing but
    /// earlier outputs.
    ///
    /// # Errors
    /// The first one that cannot, or is of another format by its extension; a negative time between states.
    pub fn new(
        scene: &scene::Scene,
        output: Option<PathBuf>,
        state: Option<PathBuf>,
        state_every: f64,
        resume: Option<PathBuf>,
        samples: Option<PathBuf>,
    ) -> PyResult<Self> {
        if !(0.0..).contains(&state_every) {
            return Err(value_error(format!(
                "state_every: found {state_every}; accepted is a number of seconds from 0 up"
            )));
        }
        if let Some(path) = &output {
            OutputFormat::from_path(path).map_err(image_error)?;
        }
        let is_npz = |path: &Path| path.extension().is_some_and(|found| found.eq_ignore_ascii_case("npz"));
        if let Some(path) = samples.as_deref().filter(|path| !is_npz(path)) {
            let name = path.display();
            return Err(value_error(format!("samples: found {name}; accepted is a name that ends in .npz")));
        }
        let mut files: Vec<&Path> = [&output, &samples].into_iter().flatten().map(PathBuf::as_path).collect();
        files.iter().try_for_each(|path| replaces_no_state(path)).map_err(value_error)?;
        state.as_deref().map_or(Ok(false), replaces_state).map_err(value_error)?;
        files.extend(state.as_deref());
        are_distinct(scene.files.iter().map(PathBuf::as_path), &files).map_err(value_error)?;
        files.into_iter().try_for_each(can_be_written)?;
        Ok(Self { output, state, state_every, resume, samples })
    }

    /// Returns whether sample vectors are written.
    pub fn has_samples(&self) -> bool {
        self.samples.is_some()
    }

    /// Reads the state from which the render goes on, if there is one; also returns its path.
    ///
    /// # Errors
    /// A file that cannot be read or is no state.
    pub fn read_state(&self) -> PyResult<Option<(&Path, RenderState)>> {
        let Some(path) = self.resume.as_deref() else { return Ok(None) };
        RenderState::read(path).map(|state| Some((path, state))).map_err(state_error)
    }

    /// Begins the file of sample vectors, if it is asked for.
    ///
    /// # Errors
    /// That of the system.
    pub fn begin_samples(&self, layout: &Layout) -> PyResult<Option<SampleFile>> {
        let begin = |path: &PathBuf| {
            SampleFile::begin(path, layout).map_err(|error| cannot_write_samples(path, &error))
        };
        self.samples.as_ref().map(begin).transpose()
    }

    /// Ends the file of sample vectors.
    ///
    /// # Errors
    /// That of the file system, whenever it occurred.
    pub fn finish_samples(&self, file: Option<SampleFile>) -> PyResult<()> {
        let (Some(path), Some(file)) = (&self.samples, file) else { return Ok(()) };
        file.finish().map_err(|error| cannot_write_samples(path, &error))
    }

    /// Begins to write the states of the samples `stream` that `renderer` takes, if they are asked for.
    ///
    /// # Errors
    /// The file cannot be written, or another program writes it.
    pub fn begin_checkpoints(
        &self,
        metadata: &ImageMetadata,
        stream: Stream,
        renderer: &Renderer,
        settings: &Settings,
    ) -> PyResult<Option<Checkpoints>> {
        let begin = |path: &PathBuf| {
            Checkpoints::begin(path, self.state_every, metadata, stream, renderer, settings)
                .map_err(|error| checkpoint_error(&error))
        };
        self.state.as_ref().map(begin).transpose()
    }

    /// Encodes the image and discards it, if it is asked for: to measure how long that takes.
    pub fn encode_output_and_discard(&self, image: &ImageOutput) {
        self.output.iter().for_each(|path| image.encode_and_discard(path));
    }

    /// Writes the image, if it is asked for.
    ///
    /// # Errors
    /// That of the file system.
    pub fn write_output(&self, image: &RenderedImage) -> PyResult<()> {
        self.output.as_ref().map_or(Ok(()), |path| image.write(path)).map_err(image_error)
    }
}

fn cannot_write_samples(path: &Path, error: &io::Error) -> PyErr {
    let message = format!("{}: cannot write the samples: {}", path.display(), error_message(error));
    file_error(error.kind(), message)
}
