//! The files that a render reads, and the paths that it writes.

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use indicatif::ProgressBar;

use super::options::RenderOptions;
use super::terminal::{escaped, print_error};
use crate::adaptive::SampleMap;
use crate::image::OutputFormat;
use crate::image::{self, Planes};
use crate::output::paths::{are_distinct, can_be_written, replaces_no_state};
use crate::scene::{Scene, pbrt};

/// The inputs of a render, and the paths of its images.
pub(super) struct Inputs {
    pub scene: Scene,
    pub outfiles: Vec<PathBuf>,
    pub reference: Option<Arc<Planes>>,
    pub sample_map: Option<SampleMap>,
}

impl Inputs {
    /// Reads the scene, the reference and the sample map; if the outputs are to be written by this process, checks that they
    /// replace nothing but earlier outputs.
    ///
    /// # Errors
    /// One line that names the file.
    pub fn read(options: &RenderOptions, writes: bool) -> anyhow::Result<Self> {
        let mut scene = read_scene(options)?;
        options.apply(&mut scene)?;
        let outfiles = outfiles(options, &mut scene);
        if writes {
            check_outputs(options, &scene, &outfiles)?;
        }
        let reference = options.reference.as_deref().map(|path| reference(path, &scene)).transpose()?;
        let reference = reference.map(Arc::new);
        let sample_map = options.sample_map.read(size(&scene))?;
        warn(options, &scene);
        Ok(Self { scene, outfiles, reference, sample_map })
    }
}

/// Checks that outputs can be written, and replace nothing but earlier outputs.
fn check_outputs(options: &RenderOptions, scene: &Scene, outfiles: &[PathBuf]) -> anyhow::Result<()> {
    let mut outputs: Vec<&Path> =
        outfiles.iter().chain(&options.report).chain(&options.samples).map(PathBuf::as_path).collect();
    outputs.iter().try_for_each(|path| replaces_no_state(path))?;
    outputs.extend(options.state.state.as_deref());
    outputs.iter().try_for_each(|path| can_be_written(path))?;
    let others = [&options.reference, &options.sample_map.sample_map, &options.denoiser.weights];
    let inputs = scene.files.iter().chain(others.into_iter().flatten());
    are_distinct(inputs.map(PathBuf::as_path), &outputs)?;
    if options.state.replaces_one()? && !options.quiet {
        print_error("warning: --state replaces the existing state; --resume would go on from it");
    }
    Ok(())
}

/// Returns the output files: those of the options, else the film's, else the scene's name with `.exr`.
fn outfiles(options: &RenderOptions, scene: &mut Scene) -> Vec<PathBuf> {
    if !options.outfile.is_empty() {
        return options.outfile.clone();
    }
    let mut fallback = options.scene.file_stem().unwrap_or_default().to_owned();
    fallback.push(".exr");
    let fallback = PathBuf::from(fallback);
    let Some(mut named) = scene.film.filename.as_ref().map(PathBuf::from) else {
        return vec![fallback];
    };
    // A scene from elsewhere must not write wherever it likes.
    let stays_here = named.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if let (false, Some(name)) = (stays_here, named.file_name()) {
        let here = PathBuf::from(name);
        scene.warnings.push(format!(
            "the film's file name {} leads out of this folder; {} is written, or what -o names",
            escaped(&named.to_string_lossy()),
            here.display()
        ));
        named = here;
    }
    if OutputFormat::from_path(&named).is_ok() {
        return vec![named];
    }
    scene.warnings.push(format!(
        "the film's file name {} has an extension other than .exr and .png; {} is written",
        escaped(&named.to_string_lossy()),
        fallback.display()
    ));
    vec![fallback]
}

/// Returns the width and height of the render.
fn size(scene: &Scene) -> (usize, usize) {
    let [x0, x1, y0, y1] = scene.film.pixel_bounds;
    (x1 - x0, y1 - y0)
}

/// Reads the reference image, which has to have the size of the render.
fn reference(path: &Path, scene: &Scene) -> anyhow::Result<Planes> {
    let reference = image::read_rgb(path)?;
    let (width, height) = size(scene);
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

/// Prints the warnings about a scene.
fn warn(options: &RenderOptions, scene: &Scene) {
    /// Warnings shown without `-v`.
    const SHOWN: usize = 8;
    if options.quiet {
        return;
    }
    if !scene.is_lit() {
        print_error("warning: the scene has no light: the image will be black");
    }
    let shown = if options.verbose { scene.warnings.len() } else { SHOWN };
    for warning in scene.warnings.iter().take(shown) {
        print_error(&format!("warning: {}", escaped(warning)));
    }
    if let Some(more) = scene.warnings.len().checked_sub(shown).filter(|&n| n > 0) {
        print_error(&format!("warning: {more} more, see `prpf info`"));
    }
}

/// Reads the scene, with a progress display.
fn read_scene(options: &RenderOptions) -> anyhow::Result<Scene> {
    let bar = if options.quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
    let shown = bar.clone();
    let scene = pbrt::read_reporting(&options.scene, options.camera.as_deref(), move |reading| {
        shown.set_message(format!("reading: {} shapes, {} triangles", reading.shapes, reading.triangles));
        shown.tick();
    });
    bar.finish_and_clear();
    Ok(scene?)
}
