//! A render from its checked arguments to its image and files.

use prpf::image::Planes;
use prpf::output::Layers;
use prpf::progressive::{RecordedStatistics, Settings};
use prpf::render::Shard;
use prpf::state::{ImageMetadata, RenderState, Stream};
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

        // Lock the state file before one is read: what another render writes to it until then is not lost
        let stream = Stream::new(settings.seed, Shard::WHOLE);
        // A file of sample vectors has every dimension
        let asked = if files.has_samples() { Some(RecordedStatistics::All) } else { statistics };
        settings.statistics = asked.unwrap_or(RecordedStatistics::All);
        let recorded = settings.recorded_blocks(Layers::blocks_read(None) | RenderState::blocks_kept());
        let checkpoints =
            files.begin_checkpoints(&metadata, stream, &renderer.recording(recorded), &settings)?;

        // Go on from the state, if there is one
        if let Some((path, state)) = files.read_state()? {
            settings.statistics = asked.unwrap_or(state.settings.statistics);
            state
                .can_resume(&metadata, stream, renderer.layout(), &settings, BlockSet::NONE)
                .map_err(|error| Error::new_err(format!("{}: {error}", path.display())))?;
            builder = builder.resume(state.checkpoint);
        }

        // Render
        if let Some(reference) = &reference {
            builder = builder.reference(reference);
        }
        let samples = files.begin_samples(renderer.layout())?;
        let seed = settings.seed;
        let mut host = RenderHost::new(callback, counts, &files, checkpoints, samples, metadata, seed);
        let rendered = builder.settings(settings).run_with(&mut host).map_err(render_error)?;
        let errors = host.finish(&rendered);
        Ok((rendered, errors))
    }
}
