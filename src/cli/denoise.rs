//! `prpf denoise`: filters a state again, or images of any renderer, without tracing a ray.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{anyhow, bail};
use clap::Args;

use super::checkpoints::warn_of_weights;
use super::command_line::command_line;
use super::denoise_images;
use super::denoiser_options::DenoiserOptions;
use super::failure::Failure;
use super::parse;
use super::summary::describe;
use super::terminal::print;
use super::workers::in_pool;
use crate::filter::{MissingData, draft_if_sparse};
use crate::image::OutputFormat;
use crate::import::LayerMap;
use crate::output::paths::{are_distinct, can_be_written, is_exr, replaces_no_state};
use crate::output::{ImageOutput, Layers};
use crate::progressive::{Checkpoint, FailureMap, FilterPass, Filtered, Settings};
use crate::state::RenderState;

/// `prpf denoise`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  prpf denoise scene.state -o out.exr
  prpf denoise scene.state --quality draft -o draft.png
  prpf denoise scene.state --denoiser none -o noisy.exr --layers Noisy

Two renders of one frame, of any renderer:
  prpf denoise a.exr b.exr -o out.exr
  prpf denoise a.exr b.exr -o out.exr --map colour=beauty --aovs key,fill

Of a state: without other options the image is the one that the render wrote. What another denoiser reads has \
to be in the state: `prpf render --statistics all` keeps every dimension, `--reservoir 8` the sample vectors \
that --denoiser prpf needs.

Of images: two renders that differ in their seeds only are the two halves of the samples. One image is enough \
if it has a layer of its variance. Layers are found under the names of pbrt-v4, Cycles, Mitsuba, Arnold and \
RenderMan, or given by --map.")]
pub(super) struct DenoiseOptions {
    /// State of `prpf render --state` or `prpf merge`; or two EXR images, or one with its variance
    #[arg(required = true, num_args = 1..=2, value_name = "STATE|IMAGE [IMAGE]")]
    pub inputs: Vec<PathBuf>,
    /// Output, .exr (all layers) or .png; may be given twice [default: STATE-denoised.exr; none
    /// for images]
    #[arg(short, long, value_name = "FILE")]
    outfile: Vec<PathBuf>,
    #[command(flatten)]
    pub denoiser: DenoiserOptions,
    /// Only these layers of the EXR beside the image, e.g. Albedo,Ns [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub layers: Option<Vec<String>>,
    /// The images' layers, where their names are not known; roles: colour, albedo, normal, position, depth, variance (of
    /// the mean), sample-variance. The layer none leaves a role out
    #[arg(long, value_name = "ROLE=LAYER,...")]
    pub map: Option<LayerMap>,
    /// The images' layers that sum to the colour, such as light groups: they are filtered with its weights and written,
    /// and sum to the filtered image
    #[arg(long, value_name = "LAYER,...", value_delimiter = ',')]
    pub aovs: Option<Vec<String>>,
    /// Worker threads [default: all cores]
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = parse::threads)]
    threads: Option<std::num::NonZeroUsize>,
    /// No summary, no warnings
    #[arg(long)]
    pub quiet: bool,
}

pub(super) fn run(options: &DenoiseOptions, start: Instant) -> Result<u8, Failure> {
    in_pool(options.threads, || denoise(options, start))
}

fn denoise(options: &DenoiseOptions, start: Instant) -> Result<u8, Failure> {
    let (is_of_images, outfiles) = check(options).map_err(Failure::Input)?;
    if is_of_images {
        return denoise_images::denoise(options, &outfiles, start);
    }

    // Filter the state
    let state = RenderState::read(&options.inputs[0]).map_err(|error| Failure::Input(error.into()))?;
    // Other weights have to be chosen before any are used
    let denoiser = options.denoiser.choose(state.settings.denoiser).map_err(Failure::Input)?;
    if options.denoiser.weights.is_none() && denoiser.name().method == state.settings.denoiser.name().method {
        warn_of_weights(&options.inputs[0], &state);
    }
    let RenderState { metadata, settings, checkpoint, .. } = state;
    let settings = Settings { denoiser, ..settings };
    let Filtered { result, side, estimate, .. } = filter(&checkpoint, &settings)?;

    // Write the images
    let Checkpoint { store, passes, .. } = &checkpoint;
    let estimate = estimate.as_ref();
    if let Some(names) = &options.layers {
        let layers = Layers::new(&result, store, estimate, &metadata, None);
        layers.check_present(names).map_err(|error| Failure::Input(error.into()))?;
    }
    let output = ImageOutput {
        result: &result,
        side,
        store,
        estimate,
        passes,
        metadata: &metadata,
        settings: &settings,
        reference: None,
        seconds: start.elapsed().as_secs_f64(),
        command_line: &command_line(),
        layers: options.layers.as_deref(),
    };
    output.write_all(&outfiles).map_err(|error| Failure::Run(error.into()))?;
    if !options.quiet {
        let files: String = outfiles.iter().map(|path| format!("{}\n", path.display())).collect();
        let spp = store.spp();
        let seconds = start.elapsed().as_secs_f64();
        let error = estimate.map(|estimate| format!("{}, ", describe(estimate))).unwrap_or_default();
        print(&format!("{seconds:.2} s, {spp:.1} samples per pixel, {error}by {}\n{files}", result.made_by))
            .map_err(Failure::Run)?;
    }
    Ok(0)
}

/// Checks the options; returns whether the inputs are images, and the output files.
fn check(options: &DenoiseOptions) -> anyhow::Result<(bool, Vec<PathBuf>)> {
    let state = &options.inputs[0];
    let is_of_images = options.inputs.len() == 2 || denoise_images::is_image(state);
    if !is_of_images && (options.map.is_some() || options.aovs.is_some()) {
        bail!("--map, --aovs: found with {}, which is no EXR image; accepted with images", state.display());
    }
    let outfiles = match options.outfile.as_slice() {
        [] if is_of_images => bail!("--outfile: found none; accepted are -o FILE.exr and -o FILE.png"),
        [] => vec![beside(state)],
        files => files.to_vec(),
    };
    for path in &outfiles {
        OutputFormat::from_path(path)?;
        can_be_written(path)?;
        replaces_no_state(path)?;
    }
    let outputs: Vec<&Path> = outfiles.iter().map(PathBuf::as_path).collect();
    are_distinct(options.inputs.iter().map(PathBuf::as_path), &outputs)?;
    for (name, is_given) in [("--layers", options.layers.is_some()), ("--aovs", options.aovs.is_some())] {
        if is_given && !outfiles.iter().any(|path| is_exr(path)) {
            bail!("{name}: found no output that has layers; accepted with -o FILE.exr");
        }
    }
    options.layers.as_deref().map_or(Ok(()), Layers::check_names)?;
    Ok((is_of_images, outfiles))
}

/// Returns the state's name with `-denoised.exr` in place of `.state`: another one than the render's image has.
fn beside(state: &Path) -> PathBuf {
    let is_plain = state.extension().is_none_or(|extension| extension == "state");
    let mut name =
        if is_plain { state.file_stem() } else { state.file_name() }.unwrap_or_default().to_owned();
    name.push("-denoised.exr");
    state.with_file_name(name)
}

/// Filters a checkpoint.
///
/// # Errors
/// Data that the denoiser reads and the state lacks; a denoiser that fails.
pub(super) fn filter(checkpoint: &Checkpoint, settings: &Settings) -> Result<Filtered, Failure> {
    let store = &checkpoint.store;
    let denoiser = draft_if_sparse(store, settings.denoiser);
    MissingData::check(store, denoiser).map_err(|missing| Failure::Input(missing.into()))?;
    let earlier = checkpoint.interim.as_ref().and_then(|interim| interim.interpolation.clone());
    let pass = FilterPass {
        failure_map: FailureMap::Carry(earlier),
        has_half_images: true,
        ..FilterPass::new(store.clone(), denoiser, settings.seed)
    };
    let filtered = pass.run();
    match &filtered.result.failure {
        Some(failure) => Err(Failure::Run(anyhow!(failure.clone()))),
        None => Ok(filtered),
    }
}
