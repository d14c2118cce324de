//! `prpf denoise`: filters a state again, without tracing a ray.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::bail;
use clap::Args;

use super::command_line::command_line;
use super::denoiser_options::DenoiserOptions;
use super::failure::Failure;
use super::output_paths::{are_distinct, can_be_written, replaces_no_state};
use super::parse;
use super::summary::describe;
use super::terminal::print;
use super::workers::in_pool;
use crate::filter::suited_to;
use crate::image::OutputFormat;
use crate::output::{ImageOutput, Layers};
use crate::progressive::{Checkpoint, FailureMap, FilterPass, Filtered, Settings};
use crate::state::RenderState;

/// `prpf denoise`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  prpf denoise scene.state -o out.exr
  prpf denoise scene.state --quality draft -o draft.png
  prpf denoise scene.state --denoiser none -o noisy.exr --layers Noisy,SampleCount

Without other options the image is the one that the render wrote. --denoiser prpf needs sample vectors in
the state: `prpf render --reservoir 8` keeps them.")]
pub(super) struct DenoiseOptions {
    /// State of `prpf render --state` or `prpf merge`
    state: PathBuf,
    /// Output, .exr (all layers) or .png; may be given twice [default: STATE.exr]
    #[arg(short, long, value_name = "FILE")]
    outfile: Vec<PathBuf>,
    #[command(flatten)]
    denoiser: DenoiserOptions,
    /// Only these layers of the EXR beside the image, e.g. Albedo,Ns [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    layers: Option<Vec<String>>,
    /// Worker threads [default: all cores]
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = parse::threads)]
    threads: Option<std::num::NonZeroUsize>,
    /// No summary
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(options: &DenoiseOptions, start: Instant) -> Result<u8, Failure> {
    in_pool(options.threads, || denoise(options, start))
}

fn denoise(options: &DenoiseOptions, start: Instant) -> Result<u8, Failure> {
    let outfiles = outfiles(options).map_err(Failure::Input)?;

    // Filter the state
    let RenderState { metadata, settings, checkpoint, .. } =
        RenderState::read(&options.state).map_err(|error| Failure::Input(error.into()))?;
    let denoiser = options.denoiser.choose(settings.denoiser).map_err(Failure::Input)?;
    let settings = Settings { denoiser, ..settings };
    let Filtered { result, estimate, .. } = filter(&checkpoint, &settings).map_err(Failure::Input)?;

    // Write the images
    let Checkpoint { store, passes, .. } = &checkpoint;
    let estimate = estimate.as_ref();
    if let Some(names) = &options.layers {
        let layers = Layers::new(&result, store, estimate, &metadata, None);
        layers.check_present(names).map_err(|error| Failure::Input(error.into()))?;
    }
    let output = ImageOutput {
        result: &result,
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
        let spp = store.samples() as f64 / store.pixels().max(1) as f64;
        let seconds = start.elapsed().as_secs_f64();
        let error = estimate.map(|estimate| format!("{}, ", describe(estimate))).unwrap_or_default();
        print(&format!("{seconds:.2} s, {spp:.1} samples per pixel, {error}by {}\n{files}", result.made_by))
            .map_err(Failure::Run)?;
    }
    Ok(0)
}

/// Returns the output files, after checking them and the names of layers.
fn outfiles(options: &DenoiseOptions) -> anyhow::Result<Vec<PathBuf>> {
    let outfiles = match options.outfile.as_slice() {
        [] => vec![beside(&options.state)],
        files => files.to_vec(),
    };
    for path in &outfiles {
        OutputFormat::from_path(path)?;
        can_be_written(path)?;
        replaces_no_state(path)?;
    }
    let outputs: Vec<&Path> = outfiles.iter().map(PathBuf::as_path).collect();
    are_distinct([&*options.state], &outputs)?;
    if let Some(names) = &options.layers {
        if !outfiles.iter().any(|path| is_exr(path)) {
            bail!("--layers: found no output that has layers; accepted with -o FILE.exr");
        }
        Layers::check_names(names)?;
    }
    Ok(outfiles)
}

/// Returns the state's name with `.exr` in place of `.state`.
fn beside(state: &Path) -> PathBuf {
    let is_plain = state.extension().is_none_or(|extension| extension == "state");
    let mut name =
        if is_plain { state.file_stem() } else { state.file_name() }.unwrap_or_default().to_owned();
    name.push(".exr");
    state.with_file_name(name)
}

fn is_exr(path: &Path) -> bool {
    matches!(OutputFormat::from_path(path), Ok(OutputFormat::Exr))
}

/// Filters a checkpoint.
///
/// # Errors
/// Fewer sample vectors than the denoiser needs.
pub(super) fn filter(checkpoint: &Checkpoint, settings: &Settings) -> anyhow::Result<Filtered> {
    let store = &checkpoint.store;
    let needed = Settings { reservoir: 0, ..settings.clone() }.reservoir_capacity();
    if store.capacity() < needed {
        bail!(
            "reservoir: found a state with {} sample vectors per pixel, and --denoiser {} needs {needed}; accepted are \
             --denoiser nlm, or a state rendered with --reservoir {needed}",
            store.capacity(),
            settings.denoiser.name()
        );
    }
    let earlier = checkpoint.interim.as_ref().and_then(|interim| interim.interpolation.clone());
    let pass = FilterPass {
        store: store.clone(),
        denoiser: suited_to(store, settings.denoiser),
        seed: settings.seed,
        failure_map: FailureMap::Carry(earlier),
    };
    Ok(pass.run())
}
