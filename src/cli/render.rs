//! `prpf render`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use super::layers::Layers;
use super::options::RenderOptions;
use super::output::{Written, are_distinct, can_be_written, encode, replaces_no_state, write_report};
use super::report::{Report, Times};
use super::signals::{INTERRUPTED, Signals};
use super::state::Kept;
use super::{Failure, escaped, in_pool, preview, summary};
use crate::filter::Filtered;
use crate::geometry::Accel;
use crate::image::formats::OutputFormat;
use crate::image::{self, Planes};
use crate::preview::{Director, Hub, Keeping, Picture, Stage};
use crate::progressive::{
    Estimated, Loop, Memory, Outcome, Progress, Seconds, Settings, StoppedBy, has_room,
};
use crate::render::Renderer;
use crate::scene::{Scene, pbrt};
use crate::state::ImageMetadata;
use crate::stats::Store;

/// Steps of the progress bar.
const BAR_STEPS: u64 = 1000;

/// Which command it is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Ends with a budget, and writes.
    Render,
    /// Stays until interrupted, and writes when asked to.
    Preview,
}

pub(super) fn run(options: &RenderOptions, mode: Mode, start: Instant) -> Result<u8, Failure> {
    // What is wrong with the command line should be known before minutes of rendering.
    for path in &options.outfile {
        OutputFormat::of(path).map_err(|error| Failure::Input(error.into()))?;
    }
    options.check().map_err(Failure::Input)?;
    let signals = Signals::listen(mode).map_err(Failure::Run)?;
    in_pool(options.threads, || run_in_pool(options, mode, &signals, start))
}

fn run_in_pool(
    options: &RenderOptions,
    mode: Mode,
    signals: &Signals,
    start: Instant,
) -> Result<u8, Failure> {
    let inputs = Inputs::read(options).map_err(Failure::Input)?;
    let Inputs { scene, outfiles, reference } = &inputs;
    let load = start.elapsed().as_secs_f64();

    let accel = Accel::build(scene);
    let stream = options.state.stream(options.seed);
    let renderer = Renderer::new(scene, &accel, options.seed).with_shard(stream.shard);
    let metadata = ImageMetadata::new(scene, &renderer);
    let build = start.elapsed().as_secs_f64() - load;

    let settings = settings(options, mode, scene).map_err(Failure::Input)?;
    let keeps = options.state.state.is_some();
    has_room(renderer.layout(), &settings, renderer.resolution(), keeps)
        .map_err(|error| Failure::Input(error.into()))?;
    // From here on no other program replaces what is read.
    let kept = options.state.keeper(&metadata, stream, &renderer, &settings).map_err(Failure::Input)?;
    let resumed = options.state.resumed(&metadata, stream, &renderer, &settings).map_err(Failure::Input)?;
    if let (Some(memory), Some(spp), false) = (&resumed, settings.budget.spp, options.quiet) {
        warn_of_more(memory, spp);
    }
    let interrupt = signals.begin();
    let bar = bar(options);
    let rehearse = |filtered: &Filtered, store: &Store| {
        let layers = Layers::of(filtered, store, None, &metadata);
        outfiles.par_iter().for_each(|path| encode(path, &layers, filtered));
        kept.iter().for_each(|kept| kept.rehearse(&settings, store));
    };
    let keep = |settings: &Settings, memory: Memory| {
        if let Some(kept) = &kept {
            kept.keep(settings, memory);
        }
    };
    let news = || kept.as_ref().and_then(Kept::news);
    let settle = || kept.as_ref().map_or(Ok(()), Kept::settle);
    let keeping =
        kept.as_ref().map(|kept| Keeping { every: kept.every, keep: &keep, news: &news, settle: &settle });
    let listen = |progress| show(&bar, progress, interrupt.load(Ordering::Relaxed));
    // Looks on until the image is written: what it waits for at its end is no part of a budget.
    let mut display = None;
    let serves = mode == Mode::Preview || options.preview.is_some();
    let outcome = if serves || options.display_server.is_some() {
        let hub = Arc::new(Hub::default());
        if serves {
            preview::serve(&hub, options.preview.flatten())?;
        }
        let (quiet, beside) = (options.quiet, bar.clone());
        let warn = move |warning: &str| {
            if !quiet {
                beside.suspend(|| super::complain(&format!("warning: {}", escaped(warning))));
            }
        };
        display = preview::display(&hub, options.display_server.as_deref(), scene, warn)?;
        let stage = Stage {
            scene,
            renderer: &renderer,
            settings: settings.clone(),
            reference: reference.as_ref(),
            closing: Some(&rehearse),
            keeping,
            resumed,
            start,
            interrupt,
            stays: mode == Mode::Preview,
            save: Box::new(|picture| save(picture, &outfiles[0], &metadata, start)),
            listen: Box::new(listen),
        };
        Director::new(hub, stage).run()
    } else {
        let circle = Loop::new(&renderer, &settings, start, interrupt, reference.as_ref());
        let mut circle = circle.closing_with(&rehearse);
        if let Some(keeping) = keeping {
            circle = circle.keeping(keeping.every, keeping.keep);
        }
        if let Some(memory) = resumed {
            circle = circle.resuming(memory);
        }
        Some(circle.run(&mut |progress| {
            listen(progress);
            news();
        }))
    };
    bar.finish_and_clear();
    let Some(outcome) = outcome else {
        // A preview that was closed.
        return kept.map_or(Ok(()), Kept::finish).map(|()| 0);
    };

    let writing = Instant::now();
    let images = write(&outcome, &inputs, &metadata, start);
    let kept = kept.map_or(Ok(()), Kept::finish);
    let (write, total) = (writing.elapsed().as_secs_f64(), start.elapsed().as_secs_f64());
    drop(display);
    let Seconds { render, filter, allocate } = outcome.seconds;
    let seconds = Times { load, build, render, filter, allocate, write, total };
    let report = options.report.as_ref().map_or(Ok(()), |path| {
        let report = Report::of(&metadata, &outcome, seconds);
        write_report(path, &report).with_context(|| format!("writing {}", path.display()))
    });
    match (images, report) {
        (Err(images), Err(report)) => return Err(Failure::Run(anyhow::anyhow!("{images}; {report:#}"))),
        (images, report) => images.and(report).map_err(Failure::Run)?,
    }
    if !options.quiet {
        super::say(&summary::of(&outcome, seconds, outfiles, options.verbose)).map_err(Failure::Run)?;
    }
    kept?;
    Ok(if outcome.stopped_by == StoppedBy::Interrupt { INTERRUPTED } else { 0 })
}

/// What is read, and where the image goes.
struct Inputs {
    scene: Scene,
    outfiles: Vec<PathBuf>,
    reference: Option<Planes>,
}

impl Inputs {
    /// Reads the scene and the reference, and sees that no output replaces anything but an output of before.
    fn read(options: &RenderOptions) -> anyhow::Result<Self> {
        let mut scene = read(options)?;
        options.apply(&mut scene)?;
        let outfiles = outfiles(options, &mut scene);
        let mut outputs: Vec<&Path> = outfiles.iter().chain(&options.report).map(PathBuf::as_path).collect();
        outputs.iter().try_for_each(|path| replaces_no_state(path))?;
        outputs.extend(options.state.state.as_deref());
        outputs.iter().try_for_each(|path| can_be_written(path))?;
        let read = scene.files.iter().chain(&options.reference);
        are_distinct(read.map(PathBuf::as_path), &outputs)?;
        if options.state.replaces_one()? && !options.quiet {
            super::complain(
                "warning: --state replaces the state that is there; with --resume it would be gone on with",
            );
        }
        let reference = options.reference.as_deref().map(|path| reference(path, &scene)).transpose()?;
        warn(options, &scene);
        Ok(Self { scene, outfiles, reference })
    }
}

fn settings(options: &RenderOptions, mode: Mode, scene: &Scene) -> anyhow::Result<Settings> {
    let mut settings = options.settings(scene);
    if mode == Mode::Preview && options.spp == Some(0) {
        // A person watches; nothing has to end it.
        settings.budget.spp = None;
    }
    options.state.budget(&mut settings.budget)?;
    Ok(settings)
}

fn warn_of_more(resumed: &Memory, spp: u32) {
    let there = resumed.store.drawn() as f64 / resumed.store.pixels().max(1) as f64;
    if there > f64::from(spp) {
        super::complain(&format!(
            "warning: the state has {there:.1} samples per pixel already, more than the {spp} that are asked for; \
             none is added"
        ));
    }
}

/// Writes the images of a finished render.
fn write(outcome: &Outcome, inputs: &Inputs, metadata: &ImageMetadata, start: Instant) -> anyhow::Result<()> {
    let Outcome { filtered, store, estimate, settings, .. } = outcome;
    let written = Written {
        layers: &Layers::of(filtered, store, estimate.as_ref(), metadata),
        store,
        image: &filtered.image,
        batches: &outcome.batches,
        metadata,
        settings,
        filter: outcome.last_filter,
        reference: inputs.reference.as_ref(),
        start,
    };
    written.write_all(&inputs.outfiles)
}

/// What was asked for, else what the scene's film says, else the scene's name with `.exr`.
fn outfiles(options: &RenderOptions, scene: &mut Scene) -> Vec<PathBuf> {
    if !options.outfile.is_empty() {
        return options.outfile.clone();
    }
    let mut fallback = options.scene.file_stem().unwrap_or_default().to_owned();
    fallback.push(".exr");
    let fallback = PathBuf::from(fallback);
    let Some(named) = scene.film.filename.as_ref().map(PathBuf::from) else {
        return vec![fallback];
    };
    if OutputFormat::of(&named).is_ok() {
        return vec![named];
    }
    scene.warnings.push(format!(
        "the film's file name {} has an extension other than .exr and .png; {} is written",
        escaped(&named.to_string_lossy()),
        fallback.display()
    ));
    vec![fallback]
}

fn reference(path: &Path, scene: &Scene) -> anyhow::Result<Planes> {
    let reference = image::formats::read_rgb(path)?;
    let [x0, x1, y0, y1] = scene.film.pixel_bounds;
    let (width, height) = (x1 - x0, y1 - y0);
    if (reference.width(), reference.height()) != (width, height) {
        anyhow::bail!(
            "{}: found a reference of {}x{} pixels; accepted is the size of the render, {width}x{height}",
            path.display(),
            reference.width(),
            reference.height()
        );
    }
    Ok(reference)
}

fn warn(options: &RenderOptions, scene: &Scene) {
    /// Warnings shown without `-v`.
    const SHOWN: usize = 8;
    if options.quiet {
        return;
    }
    if !scene.is_lit() {
        super::complain("warning: the scene has no light, so that the image will be black");
    }
    let shown = if options.verbose { scene.warnings.len() } else { SHOWN };
    for warning in scene.warnings.iter().take(shown) {
        super::complain(&format!("warning: {}", escaped(warning)));
    }
    if let Some(more) = scene.warnings.len().checked_sub(shown).filter(|&n| n > 0) {
        super::complain(&format!("warning: {more} more, see `prpf info`"));
    }
}

/// Reads the scene, showing how far it has come.
fn read(options: &RenderOptions) -> anyhow::Result<Scene> {
    let bar = if options.quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
    let shown = bar.clone();
    let scene = pbrt::read_reporting(&options.scene, move |reading| {
        shown.set_message(format!("reading: {} shapes, {} triangles", reading.shapes, reading.triangles));
        shown.tick();
    });
    bar.finish_and_clear();
    Ok(scene?)
}

fn bar(options: &RenderOptions) -> ProgressBar {
    if options.quiet {
        return ProgressBar::hidden();
    }
    let style =
        ProgressStyle::with_template("{elapsed_precise} [{bar:32}] {percent:>3} %  {msg}  to go {eta}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(BAR_STEPS).with_style(style)
}

fn show(bar: &ProgressBar, progress: Progress, stopping: bool) {
    let sign = |estimate: &Estimated| if estimate.is_hidden { '<' } else { '~' };
    let error =
        progress.estimate.map(|e| format!("  relMSE {}{:.2e}", sign(&e), e.error)).unwrap_or_default();
    let stopping = if stopping { "  ending soon, Ctrl-C quits at once" } else { "" };
    bar.set_message(format!("{:.1} spp{error}{stopping}", progress.spp));
    bar.set_position((progress.fraction * BAR_STEPS as f64) as u64);
}

/// Writes the image of a render that goes on, as EXR and PNG.
fn save(
    picture: &Picture,
    outfile: &Path,
    metadata: &ImageMetadata,
    start: Instant,
) -> Result<Vec<PathBuf>, String> {
    let names = preview::next_names(outfile).ok_or("all numbers are taken")?;
    let layers = Layers::of(picture.filtered, picture.store, None, metadata);
    let written = Written {
        layers: &layers,
        store: picture.store,
        image: &picture.filtered.image,
        batches: &[],
        metadata,
        settings: picture.settings,
        filter: picture.made_by,
        reference: None,
        start,
    };
    for name in &names {
        written.write(name).map_err(|error| error.to_string())?;
    }
    Ok(names.into())
}
