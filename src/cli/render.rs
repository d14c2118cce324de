//! `prpf render`.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::Context;
use indicatif::ProgressBar;

use super::checkpoints::{self, Checkpoints};
use super::command_line::command_line;
use super::failure::Failure;
use super::host::{RenderHost, progress_bar};
use super::inputs::Inputs;
use super::mode::Mode;
use super::options::RenderOptions;
use super::signals::{INTERRUPTED, Signals};
use super::terminal::{escaped, print, print_error};
use super::workers::in_pool;
use super::{samples, summary, viewers};
use crate::geometry::Accel;
use crate::image::OutputFormat;
use crate::output::{ImageOutput, Report, Times};
use crate::preview::{Configuration, Controller, Hub, Server, TevClient};
use crate::progressive::{self, Checkpoint, Outcome, RenderLoop, Settings, StoppedBy, fits_in_memory};
use crate::render::Renderer;
use crate::state::{ImageMetadata, SampleFile};

pub(super) fn run(options: &RenderOptions, mode: Mode, start: Instant) -> Result<u8, Failure> {
    // Errors of the command line are found before minutes of rendering.
    for path in &options.outfile {
        OutputFormat::from_path(path).map_err(|error| Failure::Input(error.into()))?;
    }
    options.check().map_err(Failure::Input)?;
    if mode == Mode::Preview && options.samples.is_some() {
        let error =
            anyhow::anyhow!("--samples: found with a preview, whose camera may move; accepted with render");
        return Err(Failure::Input(error));
    }
    let signals = Signals::listen(mode).map_err(Failure::Run)?;
    in_pool(options.threads, || run_in_pool(options, mode, &signals, start))
}

fn run_in_pool(
    options: &RenderOptions,
    mode: Mode,
    signals: &Signals,
    start: Instant,
) -> Result<u8, Failure> {
    // Read the inputs
    let inputs = Inputs::read(options).map_err(Failure::Input)?;
    let scene = &inputs.scene;
    let load = start.elapsed().as_secs_f64();

    // Build the acceleration structure
    let accel = Accel::build(scene);
    let stream = options.state.stream(options.seed);
    let renderer = Renderer::new(scene, &accel, options.seed).with_shard(stream.shard);
    if let Some(sample) = options.debug_sample {
        let text = sample.describe(&renderer).map_err(Failure::Input)?;
        return print(&text).map(|()| 0).map_err(Failure::Run);
    }
    let metadata = ImageMetadata::new(scene, &renderer);
    let build = start.elapsed().as_secs_f64() - load;

    // Render
    let job = Job { options, mode, inputs: &inputs, renderer: &renderer, metadata: &metadata, start };
    let settings = job.settings().map_err(Failure::Input)?;
    let Rendered { outcome, metadata, checkpoints, samples, display, server } =
        job.render(&settings, signals.begin_render())?;
    let Some(outcome) = outcome else {
        // A preview that was closed has written its images already.
        let finished = checkpoints.map_or(Ok(()), Checkpoints::finish).map(|()| 0);
        server.into_iter().for_each(|server| server.close("The preview was closed."));
        return finished;
    };

    // Write the outputs
    let writing = Instant::now();
    let images = job.write_images(&outcome, &metadata);
    let checkpoints = checkpoints.map_or(Ok(()), Checkpoints::finish);
    let samples = samples::finish(samples, options.samples.as_deref());
    let (write, total) = (writing.elapsed().as_secs_f64(), start.elapsed().as_secs_f64());
    drop(display);
    server.into_iter().for_each(|server| server.close("The render has ended."));
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
    Ok(if outcome.stopped_by == StoppedBy::Interrupt { INTERRUPTED } else { 0 })
}

/// A render that is ready to begin.
struct Job<'a> {
    options: &'a RenderOptions,
    mode: Mode,
    inputs: &'a Inputs,
    renderer: &'a Renderer<'a>,
    metadata: &'a ImageMetadata,
    start: Instant,
}

/// What a render leaves to the command.
struct Rendered {
    /// `None` of a preview that was closed.
    outcome: Option<Outcome>,
    /// With the camera of the outcome.
    metadata: ImageMetadata,
    checkpoints: Option<Checkpoints>,
    samples: Option<SampleFile>,
    /// Dropped after the image is written: disconnecting may take time, which is part of no budget.
    display: Option<TevClient>,
    /// Closed after the outputs are written.
    server: Option<Server>,
}

impl Job<'_> {
    fn settings(&self) -> anyhow::Result<Settings> {
        let mut settings = self.options.settings(&self.inputs.scene)?;
        if self.mode == Mode::Preview && self.options.spp == Some(0) {
            // A user watches: nothing has to end it.
            settings.budget.spp = None;
        }
        self.options.state.apply_shard(&mut settings.budget)?;
        self.apply_sample_map(&mut settings);
        Ok(settings)
    }

    /// Lets samples follow the map, of whose counts a shard renders its part.
    fn apply_sample_map(&self, settings: &mut Settings) {
        let Some(map) = self.inputs.sample_map.clone() else { return };
        let map = map.map_counts(|count| self.options.state.shard.samples_among(count));
        if let Some(total) = map.total() {
            settings.budget.spp = Some(total.div_ceil(map.values().len() as u64) as u32);
        }
        settings.sample_map = Some(map);
    }

    /// Renders, with a live page and a display server if the options ask for them.
    fn render(&self, settings: &Settings, interrupt: &AtomicBool) -> Result<Rendered, Failure> {
        let Self { options, inputs, renderer, metadata, start, .. } = *self;
        // Check the memory, and open the state
        let keeps_checkpoints = options.state.state.is_some();
        fits_in_memory(renderer.layout(), settings, renderer.resolution(), keeps_checkpoints)
            .map_err(|error| Failure::Input(error.into()))?;
        // The state file is locked from here on.
        let writer = Checkpoints::begin(&options.state, metadata, renderer, settings);
        let checkpoints = writer.map_err(Failure::Input)?;
        let checkpoint =
            checkpoints::read(&options.state, metadata, renderer, settings).map_err(Failure::Input)?;
        if let (Some(checkpoint), Some(spp), false) = (&checkpoint, settings.budget.spp, options.quiet) {
            warn_of_surplus(checkpoint, spp);
        }

        let taken = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.store.samples_taken());
        let begin = |path| samples::begin(path, renderer, settings, taken, options.quiet);
        let samples = options.samples.as_deref().map(begin);

        // Run the render loop, by one of its drivers
        let bar = progress_bar(options.quiet);
        let serves = self.mode == Mode::Preview || options.preview.is_some();
        let has_viewers = serves || options.display_server.is_some();
        let outfiles = &inputs.outfiles;
        let mut host = RenderHost {
            metadata,
            outfiles,
            checkpoints,
            samples,
            interrupt,
            has_viewers,
            bar: bar.clone(),
            start,
        };
        let mut metadata = metadata.clone();
        let mut server = None;
        let (outcome, display) = if has_viewers {
            let hub = Arc::new(Hub::default());
            if serves {
                server = Some(viewers::serve(&hub, options.preview.flatten())?);
            }
            let display = self.display(&hub, &bar)?;
            let configuration = Configuration {
                scene: &inputs.scene,
                renderer,
                settings: settings.clone(),
                reference: inputs.reference.clone(),
                checkpoint,
                start,
                stays: self.mode == Mode::Preview,
                host: &mut host,
            };
            let outcome = Controller::new(hub, configuration).run().map(|(outcome, camera)| {
                metadata = metadata.with_camera(&camera);
                outcome
            });
            (outcome, display)
        } else {
            let render_loop = RenderLoop::new(renderer, settings, start);
            let mut render_loop = render_loop.with_reference(inputs.reference.as_deref());
            if let Some(checkpoint) = checkpoint {
                render_loop = render_loop.resume(checkpoint);
            }
            (Some(progressive::run(render_loop, &mut host)), None)
        };
        bar.finish_and_clear();
        let RenderHost { checkpoints, samples, .. } = host;
        Ok(Rendered { outcome, metadata, checkpoints, samples, display, server })
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
