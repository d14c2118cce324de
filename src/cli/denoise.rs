//! `prpf denoise`: filters a state again, without tracing a ray.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{anyhow, bail};
use clap::Args;

use super::layers::Layers;
use super::options::DenoiserOption;
use super::output::{Written, are_distinct, can_be_written, replaces_no_state};
use super::{Failure, in_pool};
use crate::filter::{Filtered, Quality};
use crate::image::formats::OutputFormat;
use crate::progressive::{FilterJob, Memory, Settings, fitting, reservoir_capacity};
use crate::state::RenderState;

/// `prpf denoise`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  prpf denoise scene.state -o out.exr
  prpf denoise scene.state --quality draft -o draft.png
  prpf denoise scene.state --denoiser none -o noisy.exr --layers Noisy,SampleCount

Without other options the image is the one that the render wrote. --quality paper needs sample vectors in
the state: `prpf render --reservoir 8` keeps them.")]
pub(super) struct DenoiseOptions {
    /// What `prpf render --state` or `prpf merge` wrote
    state: PathBuf,
    /// Output, .exr (all layers) or .png; may be given twice [default: STATE.exr]
    #[arg(short, long, value_name = "FILE")]
    outfile: Vec<PathBuf>,
    /// The reconstruction [default: the render's]
    #[arg(long, value_enum)]
    denoiser: Option<DenoiserOption>,
    /// Filter effort [default: the render's]
    #[arg(long, value_enum)]
    quality: Option<Quality>,
    /// Only these layers of the EXR beside the image, e.g. Albedo,Ns [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    layers: Option<Vec<String>>,
    /// Worker threads [default: all cores]
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = super::parse_threads)]
    threads: Option<std::num::NonZeroUsize>,
    /// No summary
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(options: &DenoiseOptions, start: Instant) -> Result<u8, Failure> {
    in_pool(options.threads, || denoise(options, start))
}

fn denoise(options: &DenoiseOptions, start: Instant) -> Result<u8, Failure> {
    let outfiles = match options.outfile.as_slice() {
        [] => vec![beside(&options.state)],
        files => files.to_vec(),
    };
    for path in &outfiles {
        OutputFormat::of(path).map_err(|error| Failure::Input(error.into()))?;
        can_be_written(path).map_err(Failure::Input)?;
        replaces_no_state(path).map_err(Failure::Input)?;
    }
    let outputs: Vec<&Path> = outfiles.iter().map(PathBuf::as_path).collect();
    are_distinct([&*options.state], &outputs).map_err(Failure::Input)?;
    if options.layers.is_some() && !outfiles.iter().any(|path| is_exr(path)) {
        return Err(Failure::Input(anyhow!(
            "--layers: found no output that has layers; accepted with -o FILE.exr"
        )));
    }
    options.layers.as_deref().map_or(Ok(()), Layers::check).map_err(Failure::Input)?;
    let RenderState { metadata, settings, memory, .. } =
        RenderState::read(&options.state).map_err(|error| Failure::Input(error.into()))?;
    let settings = Settings {
        denoiser: options.denoiser.map_or(settings.denoiser, Into::into),
        quality: options.quality.unwrap_or(settings.quality),
        ..settings
    };
    let store = &memory.store;
    let filtered = filtered(&memory, &settings).map_err(Failure::Input)?;

    let mut layers = Layers::of(&filtered, store, memory.estimate.as_ref(), &metadata);
    if let Some(names) = &options.layers {
        layers.keep_only(names).map_err(Failure::Input)?;
    }
    let written = Written {
        layers: &layers,
        store,
        image: &filtered.image,
        batches: &memory.batches,
        metadata: &metadata,
        settings: &settings,
        filter: fitting(store, settings.denoiser, settings.quality),
        reference: None,
        start,
    };
    written.write_all(&outfiles).map_err(Failure::Run)?;
    if !options.quiet {
        let files: String = outfiles.iter().map(|path| format!("{}\n", path.display())).collect();
        let spp = store.samples() as f64 / store.pixels().max(1) as f64;
        let seconds = start.elapsed().as_secs_f64();
        super::say(&format!("{seconds:.2} s, {spp:.1} samples per pixel\n{files}")).map_err(Failure::Run)?;
    }
    Ok(0)
}

/// The state's name, `.state` left out, and `.exr`.
fn beside(state: &Path) -> PathBuf {
    let is_plain = state.extension().is_none_or(|extension| extension == "state");
    let mut name =
        if is_plain { state.file_stem() } else { state.file_name() }.unwrap_or_default().to_owned();
    name.push(".exr");
    state.with_file_name(name)
}

fn is_exr(path: &Path) -> bool {
    matches!(OutputFormat::of(path), Ok(OutputFormat::Exr))
}

/// What the filter makes of a state.
///
/// # Errors
/// A state without what the filter needs.
pub(super) fn filtered(memory: &Memory, settings: &Settings) -> anyhow::Result<Filtered> {
    let capacity = memory.store.capacity();
    let needed = reservoir_capacity(&Settings { reservoir: 0, ..settings.clone() });
    if capacity < needed {
        bail!(
            "reservoir: found a state with {capacity} sample vectors per pixel, and this filter needs {needed}; \
             accepted are P-RPF in draft and standard quality, or a state rendered with --reservoir {needed}"
        );
    }
    let &Settings { denoiser, quality, seed, .. } = settings;
    let (denoiser, quality) = fitting(&memory.store, denoiser, quality);
    let job = FilterJob { store: memory.store.clone(), denoiser, quality, seed, interpolation: false };
    let mut filtered = job.run().filtered;
    let failure = memory.rerun.as_ref().and_then(|rerun| rerun.failure.clone());
    filtered.interpolation_failure = filtered.interpolation_failure.or(failure);
    Ok(filtered)
}
