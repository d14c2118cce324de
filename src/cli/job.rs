//! The render of one scene, by the driver that the options ask for.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::ensure;
use indicatif::ProgressBar;

use super::checkpoints;
use super::command_line::command_line;
use super::failure::Failure;
use super::host::{RenderHost, progress_bar};
use super::inputs::Inputs;
use super::mode::Mode;
use super::options::RenderOptions;
use super::processes::Processes;
use super::samples;
use super::scene_files::scenes_beside;
use super::terminal::{escaped, print_error};
use super::viewers::{self, Viewers};
use crate::output::paths::is_exr;
use crate::output::{ImageOutput, Layers};
use crate::preview::{self, Configuration, Controller, ControllerEnd, Hub, SceneSession, TevClient};
use crate::progressive::{self, Checkpoint, Outcome, RenderLoop, Settings, fits_in_memory};
use crate::render::Renderer;
use crate::state::{Checkpoints, ImageMetadata, RenderState, SampleFile};
use crate::stats::BlockSet;

/// A render that is ready to begin.
pub(super) struct Job<'a> {
    pub options: &'a RenderOptions,
    pub mode: Mode,
    pub processes: Option<&'a Processes>,
    pub inputs: &'a Inputs,
    pub renderer: &'a Renderer<'a>,
    pub metadata: &'a ImageMetadata,
    pub start: Instant,
}

/// What a render leaves to the command.
pub(super) struct Rendered {
    pub end: ControllerEnd,
    /// Why images were not saved that viewers have asked for in the end.
    pub unsaved: Vec<String>,
    pub checkpoints: Option<Checkpoints>,
    pub samples: Option<SampleFile>,
}

impl Job<'_> {
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let mut settings = self.options.settings(&self.inputs.scene, self.process_count())?;
        if self.mode == Mode::Preview && self.options.spp == Some(0) {
            // A user watches: nothing has to end it.
            settings.budget.spp = None;
        }
        self.options.state.apply_shard(&mut settings.budget)?;
        self.apply_sample_map(&mut settings)?;
        settings.validate()?;
        // A page saves EXR images, whatever the outputs are
        let has_layers = self.serves() || self.inputs.outfiles.iter().any(|path| is_exr(path));
        ensure!(
            has_layers || self.options.layers.is_none(),
            "--layers: found no output that has layers; accepted with -o FILE.exr"
        );
        Ok(settings)
    }

    /// Lets samples follow the map, of whose counts a shard renders its part.
    ///
    /// # Errors
    /// A shard without samples.
    fn apply_sample_map(&self, settings: &mut Settings) -> anyhow::Result<()> {
        let Some(map) = self.inputs.sample_map.clone() else { return Ok(()) };
        let shard = self.options.state.shard;
        let map = map.map_counts(|count| shard.samples_among(count));
        if let Some(total) = map.total() {
            ensure!(
                total > 0,
                "--shard {shard}: found a shard without samples, by the counts of --sample-map; accepted are fewer shards"
            );
            settings.budget.spp = Some(total.div_ceil(map.values().len() as u64) as u32);
        }
        settings.sample_map = Some(map);
        Ok(())
    }

    /// Renders, with a live page and a display server if the options ask for them. With viewers it goes on from a session,
    /// and begins with a notice. The session is taken when nothing can fail any more.
    pub fn render(
        &self,
        settings: &Settings,
        interrupt: &AtomicBool,
        (session, notice): (&mut Option<SceneSession>, Option<String>),
        viewers: &mut Option<Viewers>,
    ) -> Result<Rendered, Failure> {
        let Self { options, inputs, metadata, start, .. } = *self;
        let outputs = self.outputs();
        let renderer = self.renderer.recording(self.recorded(settings, outputs));

        // Open the state. What a session holds is newer, and in memory already
        let goes_on = session.as_ref().is_some_and(|session| session.has_renders_of(&inputs.scene.hash));
        if !goes_on {
            let keeps_checkpoints = options.state.state.is_some();
            let (size, processes) = (renderer.resolution(), self.process_count());
            fits_in_memory(renderer.layout(), settings, size, keeps_checkpoints, processes)
                .map_err(|error| Failure::Input(error.into()))?;
        }
        // The state file is locked from here on.
        let checkpoints = checkpoints::begin(&options.state, metadata, &renderer, settings);
        let checkpoints = checkpoints.map_err(Failure::Input)?;
        let checkpoint = if goes_on { None } else { self.read_state(settings, &renderer)? };
        // A state may hold more than is needed now.
        let found = checkpoint.as_ref().map(|found| renderer.recording(found.store.layout().blocks()));
        let renderer = &found.unwrap_or(renderer);

        let taken = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.store.samples_taken());
        let begin = |path| samples::begin(path, renderer, settings, taken, options.quiet);
        let samples = options.samples.as_deref().map(begin).transpose()?;

        // Run the render loop, by one of its drivers
        let bar = progress_bar(options.quiet);
        let has_viewers = self.serves() || options.display_server.is_some();
        let mut host = RenderHost {
            metadata,
            outfiles: &inputs.outfiles,
            layers: options.layers.as_deref(),
            checkpoints,
            samples,
            interrupt,
            has_viewers,
            bar: bar.clone(),
            start,
        };
        let (end, unsaved) = if has_viewers {
            let hub = self.connect(viewers, &bar)?;
            hub.drop_commands();
            let configuration = Configuration {
                scene: &inputs.scene,
                renderer,
                settings: settings.clone(),
                outputs,
                reference: inputs.reference.clone(),
                checkpoint,
                session: session.take(),
                notice,
                start,
                stays: self.mode == Mode::Preview,
                host: &mut host,
            };
            Controller::new(hub, configuration).run()
        } else {
            (self.run_alone(settings, renderer, checkpoint, &mut host), Vec::new())
        };
        bar.finish_and_clear();
        let RenderHost { checkpoints, samples, .. } = host;
        Ok(Rendered { end, unsaved, checkpoints, samples })
    }

    fn process_count(&self) -> usize {
        self.processes.map_or(1, Processes::count)
    }

    /// Whether there is a live page.
    fn serves(&self) -> bool {
        self.mode == Mode::Preview || self.options.preview.is_some()
    }

    /// What the outputs read of the store.
    fn outputs(&self) -> BlockSet {
        let layers = Layers::blocks_read(self.options.layers.as_deref());
        match self.options.state.state {
            Some(_) => layers | RenderState::blocks_kept(),
            None => layers,
        }
    }

    /// What is recorded of samples.
    fn recorded(&self, settings: &Settings, outputs: BlockSet) -> BlockSet {
        match (self.serves(), &self.options.samples) {
            // A file of sample vectors has every dimension.
            (_, Some(_)) => BlockSet::ALL,
            (true, None) => preview::recorded_blocks(settings, outputs),
            (false, None) => settings.recorded_blocks(outputs),
        }
    }

    /// Reads the state that is to be resumed, if there is one.
    fn read_state(&self, settings: &Settings, renderer: &Renderer) -> Result<Option<Checkpoint>, Failure> {
        let options = self.options;
        let asked = match (&options.samples, &options.layers) {
            (Some(_), _) => BlockSet::ALL,
            (None, Some(names)) => Layers::blocks_read(Some(names)),
            (None, None) => BlockSet::NONE,
        };
        let checkpoint = checkpoints::read(&options.state, self.metadata, renderer, settings, asked)
            .map_err(Failure::Input)?;
        if let (Some(checkpoint), Some(spp), false) = (&checkpoint, settings.budget.spp, options.quiet) {
            warn_of_surplus(checkpoint, spp);
        }
        Ok(checkpoint)
    }

    /// Renders without viewers, with the other processes if there are any.
    fn run_alone(
        &self,
        settings: &Settings,
        renderer: &Renderer,
        checkpoint: Option<Checkpoint>,
        host: &mut RenderHost,
    ) -> ControllerEnd {
        let capacity = checkpoint.as_ref().map(|checkpoint| checkpoint.store.capacity());
        let reservoirs = (capacity.unwrap_or(settings.reservoir_capacity()), settings.seed);
        let interrupt = host.interrupt;
        let mut processes =
            self.processes.map(|processes| processes.coordinator(renderer, reservoirs, interrupt));
        let render_loop = match checkpoint {
            Some(checkpoint) => RenderLoop::resume(renderer, settings, self.start, checkpoint),
            None => RenderLoop::new(renderer, settings, self.start),
        };
        let mut render_loop = render_loop.with_reference(self.inputs.reference.as_deref());
        if let Some(processes) = &mut processes {
            render_loop = render_loop.with_processes(&mut **processes);
        }
        let outcome = progressive::run(render_loop, host);
        ControllerEnd::Finished(Box::new(outcome), self.inputs.scene.camera.clone())
    }

    /// Connects viewers, unless they are from the scene before; returns what they are connected to.
    fn connect(&self, viewers: &mut Option<Viewers>, bar: &ProgressBar) -> Result<Arc<Hub>, Failure> {
        if let Some(Viewers { hub, .. }) = viewers {
            return Ok(hub.clone());
        }
        let (options, hub) = (self.options, Arc::new(Hub::default()));
        let mut server = None;
        if self.mode == Mode::Preview {
            hub.offer_scenes(scenes_beside(&options.scene));
        }
        if self.serves() {
            server = Some(viewers::serve(&hub, options.preview.flatten())?);
        }
        let display = self.display(&hub, bar)?;
        *viewers = Some(Viewers { hub: hub.clone(), server, display });
        Ok(hub)
    }

    /// Starts to send images to a display server, if the options name one.
    fn display(&self, hub: &Arc<Hub>, bar: &ProgressBar) -> Result<Option<TevClient>, Failure> {
        let (is_quiet, bar) = (self.options.quiet, bar.clone());
        let warn = move |warning: &str| {
            if !is_quiet {
                bar.suspend(|| print_error(&format!("warning: {}", escaped(warning))));
            }
        };
        viewers::display(hub, self.options.display_server.as_deref(), &self.inputs.scene, warn)
    }

    pub fn write_images(&self, outcome: &Outcome, metadata: &ImageMetadata) -> anyhow::Result<()> {
        let output = ImageOutput {
            reference: self.inputs.reference.as_deref(),
            seconds: self.start.elapsed().as_secs_f64(),
            command_line: &command_line(),
            layers: self.options.layers.as_deref(),
            ..ImageOutput::new(outcome, metadata)
        };
        Ok(output.write_all(&self.inputs.outfiles)?)
    }
}

/// Warns if a checkpoint has more samples than the budget.
fn warn_of_surplus(checkpoint: &Checkpoint, spp: u32) {
    let store = &checkpoint.store;
    let found = store.samples_taken() as f64 / store.pixels().max(1) as f64;
    if found > f64::from(spp) {
        print_error(&format!(
            "warning: the state has {found:.1} samples per pixel, more than the {spp} of --spp; none is added"
        ));
    }
}
