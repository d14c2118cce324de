//! `prpf render`.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::{Context, ensure};
use indicatif::ProgressBar;

use super::checkpoints::{self, Checkpoints};
use super::command_line::command_line;
use super::failure::Failure;
use super::host::{RenderHost, progress_bar};
use super::inputs::Inputs;
use super::mode::Mode;
use super::options::RenderOptions;
use super::processes::Processes;
use super::scene_changes::SceneChanges;
use super::scene_files::scenes_beside;
use super::signals::{INTERRUPTED, Signals};
use super::terminal::{escaped, print, print_error};
use super::viewers::Viewers;
use super::workers::in_pool;
use super::{processes, samples, summary, viewers};
use crate::filter::DENOISERS;
use crate::geometry::Accel;
use crate::image::OutputFormat;
use crate::output::{ImageOutput, Layers, Report, Times};
use crate::preview::{self, Configuration, Controller, ControllerEnd, Hub, SceneSession, TevClient};
use crate::progressive::{self, Checkpoint, Outcome, RenderLoop, Settings, StoppedBy, fits_in_memory};
use crate::render::Renderer;
use crate::state::{ImageMetadata, SampleFile};
use crate::stats::BlockSet;

pub(super) fn run(options: &RenderOptions, mode: Mode, start: Instant) -> Result<u8, Failure> {
    let Some(processes) = processes::start()? else {
        return match processes::launched_apart(options) {
            Some((error, true)) => Err(Failure::Input(error)),
            Some((_, false)) => Ok(2),
            None => run_process(options, mode, None, start),
        };
    };
    let result = if processes.is_first() {
        run_process(options, mode, Some(&processes), start)
    } else {
        run_process(&processes::follower_options(options), mode, Some(&processes), start)
    };
    processes::finish(&processes, result)
}

/// Runs the command in this process, which may be one of several.
fn run_process(
    options: &RenderOptions,
    mode: Mode,
    processes: Option<&Processes>,
    start: Instant,
) -> Result<u8, Failure> {
    // Errors of the command line are found before minutes of rendering.
    for path in &options.outfile {
        OutputFormat::from_path(path).map_err(|error| Failure::Input(error.into()))?;
    }
    options.check().map_err(Failure::Input)?;
    processes
        .map_or(Ok(()), |processes| processes::check(processes, options, mode))
        .map_err(Failure::Input)?;
    if mode == Mode::Preview && options.samples.is_some() {
        let error =
            anyhow::anyhow!("--samples: found with a preview, whose camera may move; accepted with render");
        return Err(Failure::Input(error));
    }
    if let Some(names) = &options.layers {
        Layers::check_names(names).map_err(|error| Failure::Input(error.into()))?;
    }
    let signals = Signals::listen(mode, processes.is_some()).map_err(Failure::Run)?;
    in_pool(options.threads, || run_in_pool(options, mode, processes, &signals, start))
}

fn run_in_pool(
    options: &RenderOptions,
    mode: Mode,
    processes: Option<&Processes>,
    signals: &Signals,
    start: Instant,
) -> Result<u8, Failure> {
    let mut viewers = None;
    let mut scenes = SceneChanges::new(options, start);
    loop {
        let is_first = viewers.is_none();
        match render_scene(&mut scenes, mode, processes, signals, &mut viewers) {
            Ok(SceneEnd::Done(status)) => return Ok(status),
            Ok(SceneEnd::Opens(scene, notice)) => scenes.open(scene, notice),
            Err(failure) if is_first => return Err(failure),
            Err(failure) => {
                let problem = scenes.go_back(&failure);
                if let (Some(problem), Some(Viewers { hub, .. })) = (problem, &viewers) {
                    // What was made of other scenes is still there
                    let name = scenes.options.scene.to_string_lossy();
                    let Some(scene) = hub.await_scene(&name, &problem, signals.begin_render()) else {
                        close(&mut viewers, CLOSED);
                        return Ok(0);
                    };
                    scenes.open(scene, None);
                }
            }
        }
        if let Some(Viewers { hub, .. }) = &viewers {
            hub.begin_loading(&scenes.options.scene.to_string_lossy(), None);
        }
    }
}

/// What viewers are told when a preview ends.
const CLOSED: &str = "The preview was closed.";

/// How the render of a scene ends.
enum SceneEnd {
    /// With an exit status.
    Done(u8),
    /// A viewer opens another scene; with a notice about this one.
    Opens(PathBuf, Option<String>),
}

/// Renders the scene that is open, and keeps what was made of it while another one is opened.
fn render_scene(
    scenes: &mut SceneChanges,
    mode: Mode,
    processes: Option<&Processes>,
    signals: &Signals,
    viewers: &mut Option<Viewers>,
) -> Result<SceneEnd, Failure> {
    let mut session = scenes.take_session();
    let end = render_until(scenes, mode, processes, signals, viewers, &mut session);
    if let Some(session) = session {
        scenes.keep(session);
    }
    end
}

/// Renders the scene that is open, from `session` on, until the render ends or another scene is to be opened. What was made of it
/// is in `session` then, and still there after a failure. Viewers stay connected.
fn render_until(
    scenes: &SceneChanges,
    mode: Mode,
    processes: Option<&Processes>,
    signals: &Signals,
    viewers: &mut Option<Viewers>,
    session: &mut Option<SceneSession>,
) -> Result<SceneEnd, Failure> {
    let (options, notice, start) = (&scenes.options, scenes.notice.clone(), scenes.start);
    // Read the inputs
    let inputs = Inputs::read(options, processes.is_none_or(Processes::is_first)).map_err(Failure::Input)?;
    let scene = &inputs.scene;
    let load = start.elapsed().as_secs_f64();

    // Build the acceleration structure
    let accel = Accel::build(scene);
    let stream = options.state.stream(options.seed);
    let renderer = Renderer::new(scene, &accel, options.seed).with_shard(stream.shard);
    if let Some(sample) = options.debug_sample {
        let text = sample.describe(&renderer).map_err(Failure::Input)?;
        return print(&text).map(|()| SceneEnd::Done(0)).map_err(Failure::Run);
    }
    let metadata = ImageMetadata::new(scene, &renderer);
    let build = start.elapsed().as_secs_f64() - load;

    // Render
    let (inputs, renderer, metadata) = (&inputs, &renderer, &metadata);
    let job = Job { options, mode, processes, inputs, renderer, metadata, start };
    let settings = job.settings().map_err(Failure::Input)?;
    if let Some(processes) = processes {
        processes::agree(processes, options, metadata, &settings)?;
        if !processes.is_first() {
            processes.serve(renderer, signals.begin_render());
            return Ok(SceneEnd::Done(0));
        }
    }
    let Rendered { end, checkpoints, samples } =
        job.render(&settings, signals.begin_render(), (session, notice), viewers)?;
    let (outcome, metadata) = match end {
        ControllerEnd::Finished(outcome, camera) => (outcome, metadata.with_camera(&camera)),
        // A preview has written its images already.
        ControllerEnd::Closed => {
            let finished = checkpoints.map_or(Ok(()), Checkpoints::finish);
            close(viewers, CLOSED);
            return finished.map(|()| SceneEnd::Done(0));
        }
        ControllerEnd::Opens(scene, made) => {
            *session = Some(*made);
            // A state that cannot be written must not end what is in memory
            let problem = checkpoints.map_or(Ok(()), Checkpoints::finish).err();
            return Ok(SceneEnd::Opens(scene, problem.map(|problem| format!("{:#}", problem.error()))));
        }
    };

    // Write the outputs
    let writing = Instant::now();
    let images = job.write_images(&outcome, &metadata);
    let checkpoints = checkpoints.map_or(Ok(()), Checkpoints::finish);
    let samples = samples::finish(samples, options.samples.as_deref());
    let (write, total) = (writing.elapsed().as_secs_f64(), start.elapsed().as_secs_f64());
    close(viewers, "The render has ended.");
    let seconds = Times::new(load, build, outcome.seconds, write, total);
    let report = options.report.as_ref().map_or(Ok(()), |path| {
        let report = Report::new(&metadata, &outcome, seconds);
        report.write(path).with_context(|| format!("writing {}", path.display()))
    });
    match (images, report) {
        (Err(images), Err(report)) => return Err(Failure::Run(anyhow::anyhow!("{images}; {report:#}"))),
        (images, report) => images.and(report).map_err(Failure::Run)?,
    }
    if !options.quiet {
        let text = summary::summary(&outcome, seconds, &inputs.outfiles, options.verbose);
        print(&text).map_err(Failure::Run)?;
    }
    checkpoints.and(samples)?;
    Ok(SceneEnd::Done(if outcome.stopped_by == StoppedBy::Interrupt { INTERRUPTED } else { 0 }))
}

/// Disconnects the viewers, and tells them why.
fn close(viewers: &mut Option<Viewers>, reason: &str) {
    if let Some(Viewers { server, display, .. }) = viewers.take() {
        drop(display);
        server.into_iter().for_each(|server| server.close(reason));
    }
}

/// A render that is ready to begin.
struct Job<'a> {
    options: &'a RenderOptions,
    mode: Mode,
    processes: Option<&'a Processes>,
    inputs: &'a Inputs,
    renderer: &'a Renderer<'a>,
    metadata: &'a ImageMetadata,
    start: Instant,
}

/// What a render leaves to the command.
struct Rendered {
    end: ControllerEnd,
    checkpoints: Option<Checkpoints>,
    samples: Option<SampleFile>,
}

impl Job<'_> {
    fn settings(&self) -> anyhow::Result<Settings> {
        let mut settings =
            self.options.settings(&self.inputs.scene, self.processes.map_or(1, Processes::count))?;
        if self.mode == Mode::Preview && self.options.spp == Some(0) {
            // A user watches: nothing has to end it.
            settings.budget.spp = None;
        }
        self.options.state.apply_shard(&mut settings.budget)?;
        self.apply_sample_map(&mut settings)?;
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
    fn render(
        &self,
        settings: &Settings,
        interrupt: &AtomicBool,
        (session, notice): (&mut Option<SceneSession>, Option<String>),
        viewers: &mut Option<Viewers>,
    ) -> Result<Rendered, Failure> {
        let Self { options, inputs, metadata, start, .. } = *self;
        let serves = self.mode == Mode::Preview || options.preview.is_some();
        // Choose what is recorded of samples
        let layers = Layers::blocks_read(options.layers.as_deref());
        let outputs = match options.state.state {
            // `prpf denoise` filters every state with the default denoiser.
            Some(_) => layers | DENOISERS[0].reads().blocks.iter().copied().collect(),
            None => layers,
        };
        let recorded = match (serves, &options.samples) {
            // A file of sample vectors has every dimension.
            (_, Some(_)) => BlockSet::ALL,
            (true, None) => preview::recorded_blocks(settings, outputs),
            (false, None) => settings.recorded_blocks(outputs),
        };
        let renderer = self.renderer.recording(recorded);

        // Check the memory, and open the state
        let keeps_checkpoints = options.state.state.is_some();
        // The store of a session is in memory already, and newer than a state
        let goes_on = session.as_ref().is_some_and(|session| session.hash == inputs.scene.hash);
        if !goes_on {
            fits_in_memory(renderer.layout(), settings, renderer.resolution(), keeps_checkpoints)
                .map_err(|error| Failure::Input(error.into()))?;
        }
        // The state file is locked from here on.
        let writer = Checkpoints::begin(&options.state, metadata, &renderer, settings);
        let checkpoints = writer.map_err(Failure::Input)?;
        let asked = match (&options.samples, &options.layers) {
            (Some(_), _) => BlockSet::ALL,
            (None, Some(names)) => Layers::blocks_read(Some(names)),
            (None, None) => BlockSet::NONE,
        };
        let checkpoint = if goes_on {
            None
        } else {
            checkpoints::read(&options.state, metadata, &renderer, settings, asked).map_err(Failure::Input)?
        };
        if let (Some(checkpoint), Some(spp), false) = (&checkpoint, settings.budget.spp, options.quiet) {
            warn_of_surplus(checkpoint, spp);
        }
        // A state may hold more than is needed now.
        let found = checkpoint.as_ref().map(|found| renderer.recording(found.store.layout().blocks()));
        let renderer = &found.unwrap_or(renderer);

        let taken = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.store.samples_taken());
        let begin = |path| samples::begin(path, renderer, settings, taken, options.quiet);
        let samples = options.samples.as_deref().map(begin).transpose()?;

        // Run the render loop, by one of its drivers
        let bar = progress_bar(options.quiet);
        let has_viewers = serves || options.display_server.is_some();
        let outfiles = &inputs.outfiles;
        let mut host = RenderHost {
            metadata,
            outfiles,
            layers: options.layers.as_deref(),
            checkpoints,
            samples,
            interrupt,
            has_viewers,
            bar: bar.clone(),
            start,
        };
        let end = if has_viewers {
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
            let capacity = checkpoint.as_ref().map(|checkpoint| checkpoint.store.capacity());
            let reservoirs = (capacity.unwrap_or(settings.reservoir_capacity()), settings.seed);
            let mut processes =
                self.processes.map(|processes| processes.coordinator(renderer, reservoirs, interrupt));
            let render_loop = match checkpoint {
                Some(checkpoint) => RenderLoop::resume(renderer, settings, start, checkpoint),
                None => RenderLoop::new(renderer, settings, start),
            };
            let mut render_loop = render_loop.with_reference(inputs.reference.as_deref());
            if let Some(processes) = &mut processes {
                render_loop = render_loop.with_processes(&mut **processes);
            }
            let outcome = progressive::run(render_loop, &mut host);
            ControllerEnd::Finished(Box::new(outcome), inputs.scene.camera.clone())
        };
        bar.finish_and_clear();
        let RenderHost { checkpoints, samples, .. } = host;
        Ok(Rendered { end, checkpoints, samples })
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
        if self.mode == Mode::Preview || options.preview.is_some() {
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

    fn write_images(&self, outcome: &Outcome, metadata: &ImageMetadata) -> anyhow::Result<()> {
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
