//! `prpf merge`: merges states of one image that hold different samples.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;

use super::failure::Failure;
use super::terminal;
use crate::output::paths::{are_distinct, can_be_written, replaces_state};
use crate::render::Shard;
use crate::state::{Merge, RenderState};

/// `prpf merge`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  prpf render scene.pbrt --spp 64 --sampling uniform --shard 1/2 --state a.state  # one machine
  prpf render scene.pbrt --spp 64 --sampling uniform --shard 2/2 --state b.state  # another
  prpf merge a.state b.state -o all.state
  prpf denoise all.state -o image.exr

The states are of the same image, and of other seeds or other shards of one seed. All shards of a \
uniformly sampled render are that render again: it can go on with --resume. Other sums can be merged \
further, filtered and exported.")]
pub(super) struct MergeOptions {
    /// State of `prpf render --state` or `prpf merge`
    #[arg(required = true, num_args = 2.., value_name = "STATE")]
    states: Vec<PathBuf>,
    /// The merged state
    #[arg(short, long, value_name = "STATE")]
    outfile: PathBuf,
    /// No summary, no warnings
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(options: &MergeOptions) -> Result<u8, Failure> {
    let states = options.states.iter().map(PathBuf::as_path);
    let checked = can_be_written(&options.outfile)
        .and_then(|()| are_distinct(states, &[&options.outfile]))
        .and_then(|()| replaces_state(&options.outfile));
    checked.map_err(|error| Failure::Input(error.into()))?;
    let sum = merge(&options.states).map_err(Failure::Input)?;
    sum.write(&options.outfile).map_err(|error| Failure::Run(error.into()))?;
    if !options.quiet {
        let store = &sum.checkpoint.store;
        let spp = store.spp();
        let streams: Vec<String> = sum.streams.iter().map(ToString::to_string).collect();
        let text =
            format!("{spp:.1} samples per pixel: {}\n{}\n", streams.join("; "), options.outfile.display());
        terminal::print(&text).map_err(Failure::Run)?;
        if let Some(warning) = missing(&sum) {
            terminal::print_error(&format!("warning: {warning}"));
        }
    }
    Ok(0)
}

/// Names the first shard that is missing in a sum of one seed; `None` if there is none, or if the sum has several seeds.
fn missing(sum: &RenderState) -> Option<String> {
    let seed = sum.streams.first()?.seed;
    if sum.streams.iter().any(|stream| stream.seed != seed) {
        return None;
    }
    let shards: Vec<Shard> = sum.streams.iter().map(|stream| stream.shard).collect();
    let missing = Shard::missing(&shards);
    let (first, count) = (missing.first()?, shards.len());
    Some(format!(
        "seed {seed}: found {count} of {} shards; the first that is missing is {first}",
        first.count()
    ))
}

fn merge(paths: &[PathBuf]) -> anyhow::Result<RenderState> {
    let read = |path: &Path| RenderState::read(path).map_err(anyhow::Error::from);
    let (first, others) = paths.split_first().context("found no state; accepted are two or more")?;
    let mut merge = Merge::new(read(first)?);
    for path in others {
        merge.add(&read(path)?).with_context(|| path.display().to_string())?;
    }
    Ok(merge.finish())
}
