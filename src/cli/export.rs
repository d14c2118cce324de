//! `prpf export`: a state as numpy arrays.

use std::path::PathBuf;

use anyhow::{Context, anyhow};
use clap::Args;

use super::checkpoints::warn_of_weights;
use super::failure::Failure;
use super::workers::in_pool;
use super::{denoise, parse, terminal};
use crate::files::replace_file;
use crate::output::paths::{are_distinct, can_be_written, replaces_no_state};
use crate::state::{self, RenderState};

/// `prpf export`.
#[derive(Args)]
#[command(after_help = "\
Example:
  prpf render scene.pbrt --denoiser prpf --spp 16 --state scene.state
  prpf export scene.state -o scene.npz
  python3 -c 'import numpy; print({n: a.shape for n, a in numpy.load(\"scene.npz\").items()})'

docs/outputs.md lists the arrays.")]
pub(super) struct ExportOptions {
    /// State of `prpf render --state` or `prpf merge`
    state: PathBuf,
    /// The archive of arrays
    #[arg(short, long, value_name = "FILE.npz")]
    outfile: PathBuf,
    /// Worker threads [default: all cores]
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = parse::threads)]
    threads: Option<std::num::NonZeroUsize>,
    /// No summary
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(options: &ExportOptions) -> Result<u8, Failure> {
    if !options.outfile.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npz")) {
        let error = anyhow!("{}: unknown extension; accepted is .npz", options.outfile.display());
        return Err(Failure::Input(error));
    }
    let checked = can_be_written(&options.outfile)
        .and_then(|()| replaces_no_state(&options.outfile))
        .and_then(|()| are_distinct([&*options.state], &[&options.outfile]));
    checked.map_err(|error| Failure::Input(error.into()))?;
    let state = RenderState::read(&options.state).map_err(|error| Failure::Input(error.into()))?;
    warn_of_weights(&options.state, &state);
    let denoiser = state.settings.denoiser;
    if let Some(reason) = denoiser.missing() {
        let error =
            anyhow!("{}: rendered with --denoiser {}: {reason}", options.state.display(), denoiser.name());
        return Err(Failure::Input(error));
    }
    in_pool(options.threads, || {
        let filtered = denoise::filter(&state.checkpoint, &state.settings)?;
        // A writer that may seek, which archives need.
        replace_file(&options.outfile, |out| state::export(&state, &filtered, out))
            .with_context(|| format!("writing {}", options.outfile.display()))
            .map_err(Failure::Run)
    })?;
    if !options.quiet {
        terminal::print(&format!("{}\n", options.outfile.display())).map_err(Failure::Run)?;
    }
    Ok(0)
}
