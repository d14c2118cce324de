//! Renders scenes from the command line, one after the other while a preview asks for more, and writes images, report and state.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;

use super::failure::Failure;
use super::inputs::Inputs;
use super::job::{Job, Rendered};
use super::mode::Mode;
use super::options::RenderOptions;
use super::processes::{self, Processes};
use super::scene_changes::SceneChanges;
use super::signals::{INTERRUPTED, Signals};
use super::terminal::print;
use super::viewers::Viewers;
use super::workers::in_pool;
use super::{checkpoints, samples, summary};
use crate::geometry::Accel;
use crate::image::OutputFormat;
use crate::output::{Layers, Report, Times};
use crate::preview::{ControllerEnd, Hub, SceneSession};
use crate::progressive::StoppedBy;
use crate::render::Renderer;
use crate::state::ImageMetadata;

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
            Ok(SceneEnd::Opens(scene, notice)) => {
                let discarded = scenes.make_room();
                if let Some(Viewers { hub, .. }) = &viewers {
                    notice_discarded(hub, &discarded);
                }
                scenes.open(scene, notice);
            }
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
            signals.begin_loading();
            hub.begin_loading(&scenes.options.scene.to_string_lossy(), None);
        }
    }
}

/// Tells viewers of which scenes the renders were discarded.
fn notice_discarded(hub: &Hub, scenes: &[PathBuf]) {
    for scene in scenes {
        let name = scene.file_name().unwrap_or_default().to_string_lossy();
        let text = format!("the renders of {name} were discarded: memory is short. Its bookmarks are kept");
        hub.notices().add(text, true);
    }
}

/// The notice to viewers when a preview ends.
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
    let Rendered { end, unsaved, checkpoints, samples } =
        job.render(&settings, signals.begin_render(), (session, notice), viewers)?;
    let (outcome, metadata) = match end {
        ControllerEnd::Finished(outcome, camera) => (outcome, metadata.with_camera(&camera)),
        // A preview has written its images already.
        ControllerEnd::Closed => {
            let finished = checkpoints::finish(checkpoints);
            close(viewers, CLOSED);
            return finished.and(check_saved(&unsaved)).map(|()| SceneEnd::Done(0));
        }
        ControllerEnd::Opens(scene, made) => {
            *session = Some(*made);
            // A state that cannot be written must not end what is in memory
            let problem = checkpoints::finish(checkpoints).err();
            return Ok(SceneEnd::Opens(scene, problem.map(|problem| format!("{:#}", problem.error()))));
        }
    };

    // Write the outputs
    let writing = Instant::now();
    let images = job.write_images(&outcome, &metadata);
    let checkpoints = checkpoints::finish(checkpoints);
    let samples = samples::finish(samples, options.samples.as_deref());
    let (write, total) = (writing.elapsed().as_secs_f64(), start.elapsed().as_secs_f64());
    close(viewers, "The render has ended.");
    let seconds = Times::new(load, build, outcome.seconds, write, total);
    let report = options.report.as_ref().map_or(Ok(()), |path| {
        let report = Report::new(&metadata, &outcome, seconds);
        report.write(path).with_context(|| format!("writing {}", path.display()))
    });
    if !options.quiet && images.is_ok() && report.is_ok() {
        let text = summary::summary(&outcome, seconds, &inputs.outfiles, options.verbose);
        print(&text).map_err(Failure::Run)?;
    }
    let outputs = [images.map_err(Failure::Run), report.map_err(Failure::Run), checkpoints, samples];
    let failures = outputs.into_iter().chain([check_saved(&unsaved)]).filter_map(Result::err);
    let failures: Vec<String> = failures.map(|failure| format!("{:#}", failure.error())).collect();
    if !failures.is_empty() {
        return Err(Failure::Run(anyhow::anyhow!(failures.join("; "))));
    }
    Ok(SceneEnd::Done(if outcome.stopped_by == StoppedBy::Interrupt { INTERRUPTED } else { 0 }))
}

/// Checks that all images were saved that viewers have asked for in the end: they may not hear of it any more.
fn check_saved(unsaved: &[String]) -> Result<(), Failure> {
    if unsaved.is_empty() { Ok(()) } else { Err(Failure::Run(anyhow::anyhow!("{}", unsaved.join("; ")))) }
}

/// Disconnects the viewers, and tells them why.
fn close(viewers: &mut Option<Viewers>, reason: &str) {
    if let Some(Viewers { server, display, .. }) = viewers.take() {
        drop(display);
        server.into_iter().for_each(|server| server.close(reason));
    }
}
