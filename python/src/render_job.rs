//! A render from its checked arguments to its image and files.

use prpf::image::Planes;
use prpf::progressive::{RecordedStatistics, Settings};
use prpf::render::Shard;
use prpf::state::{ImageMetadata, Stream};
use prpf::stats::BlockSet;
use prpf::{RenderBuilder, RenderedImage};
use pyo3::prelude::*;

use crate::errors::{Error, render_error};
use crate::render_files::RenderFiles;
use crate::render_host::RenderHost;
use crate::scene::Scene;

/// A render to come.
pub struct RenderJob<'a> {
    pub scene: &'a Scene,
    /// All settings but their statistics.
    pub settings: Settings,
    /// `None`: every dimension, or those of the state from which the render goes on.
    pub statistics: Option<RecordedStatistics>,
    pub files: RenderFiles,
    /// 3 planes.
    pub reference: Option<Planes>,
    /// Called after every filter pass.
    pub callback: Option<Py<PyAny>>,
    /// Chooses the counts of batches.
    pub counts: Option<Py<PyAny>>,
}

impl RenderJob<'_> {
    /// Renders, and writes all files, even if something ends the render early. Also returns what did, then why files could not
    /// be written.
    ///
    /// # Errors
    /// Why it cannot begin.
    pub fn run(self) -> PyResult<(RenderedImage, Vec<PyErr>)> {
        let Self { scene, mut settings, statistics, files, reference, callback, counts } = self;
        // The time of the render counts from here
        let mut builder = RenderBuilder::new(&scene.scene).accel(scene.accel());
        let renderer = scene.renderer(settings.seed);
        let metadata = ImageMetadata::new(&scene.scene, &renderer);

        // Go on from the state, if there is one
        let stream = Stream::new(settings.seed, Shard::WHOLE);
        let state = files.read_state()?;
        settings.statistics = match (&state, statistics) {
            // A file of sample vectors has every dimension
            _ if files.has_samples() => RecordedStatistics::All,
            (_, Some(asked)) => asked,
            (Some((_, state)), None) => state.settings.statistics,
            (None, None) => RecordedStatistics::All,
        };
        if let Some((path, state)) = state {
            state
                .can_resume(&metadata, stream, renderer.layout(), &settings, BlockSet::NONE)
                .map_err(|error| Error::new_err(format!("{}: {error}", path.display())))?;
            builder = builder.resume(state.checkpoint);
        }

        // Render
        if let Some(reference) = &reference {
            builder = builder.reference(reference);
        }
        let builder = builder.settings(settings.clone());
        let renderer = renderer.recording(builder.recorded_blocks(files.has_state()));
        let checkpoints = files.begin_checkpoints(&metadata, stream, &renderer, &settings)?;
        let samples = files.begin_samples(renderer.layout())?;
        let seed = settings.seed;
        let mut host = RenderHost::new(callback, counts, &files, checkpoints, samples, metadata, seed);
        let rendered = builder.run_with(&mut host).map_err(render_error)?;
        let errors = host.finish(&rendered);
        Ok((rendered, errors))
    }
}
