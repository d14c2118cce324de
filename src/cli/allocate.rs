//! `prpf allocate`: decides how many samples each pixel of a state is to have next, for renders that only share files.

use std::path::{Path, PathBuf};

use anyhow::{anyhow, bail};
use clap::Args;

use super::denoise::filter;
use super::denoiser_options::DenoiserOptions;
use super::failure::Failure;
use super::workers::in_pool;
use super::{parse, terminal};
use crate::adaptive::{NO_CEILING, Sampling};
use crate::filter::DEFAULT;
use crate::image::exr_file::{self, Channel, Precision, Windows};
use crate::output::paths::{are_distinct, can_be_written, replaces_no_state};
use crate::progressive::{Settings, allocate_after};
use crate::state::RenderState;

/// Counts up to this are exact in the file.
const MOST_SAMPLES: u32 = 1 << 24;

/// `prpf allocate`.
#[derive(Args)]
#[command(after_help = "\
Example of a round on two machines:
  prpf merge 1.state 2.state -o all.state
  prpf allocate all.state --spp 32 -o counts.exr
and on the first machine, with 2/2 and 2.state on the second,
  prpf render scene.pbrt --shard 1/2 --state 1.state --resume \\
    --sample-map counts.exr --sample-map-values absolute

The counts include the samples that the state has. --denoiser chooses the filter whose maps place the samples.")]
pub(super) struct AllocateOptions {
    /// State of `prpf render --state` or `prpf merge`
    state: PathBuf,
    /// Samples per pixel, on average, that the image is to have in all
    #[arg(long, value_name = "N")]
    spp: u32,
    /// Map of the counts, for `prpf render --sample-map`
    #[arg(short, long, value_name = "FILE.exr")]
    outfile: PathBuf,
    #[command(flatten)]
    denoiser: DenoiserOptions,
    /// Worker threads [default: all cores]
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = parse::threads)]
    threads: Option<std::num::NonZeroUsize>,
    /// No summary
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(options: &AllocateOptions) -> Result<u8, Failure> {
    check(options).map_err(Failure::Input)?;
    let state = RenderState::read(&options.state).map_err(|error| Failure::Input(error.into()))?;
    let size = [state.checkpoint.store.width(), state.checkpoint.store.height()];
    let counts = in_pool(options.threads, || allocate(options, state))?;
    write(&options.outfile, size, &counts)?;
    if !options.quiet {
        let [least, most] = [counts.iter().min(), counts.iter().max()].map(|count| count.unwrap_or(&0));
        let text = format!(
            "{} samples per pixel, from {least} to {most}\n{}\n",
            options.spp,
            options.outfile.display()
        );
        terminal::print(&text).map_err(Failure::Run)?;
    }
    Ok(0)
}

/// Checks the options.
///
/// # Errors
/// An output that is no EXR, that cannot be written, or that would replace an input.
fn check(options: &AllocateOptions) -> anyhow::Result<()> {
    if !options.outfile.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        bail!("{}: unknown extension; accepted is .exr", options.outfile.display());
    }
    can_be_written(&options.outfile)?;
    replaces_no_state(&options.outfile)?;
    are_distinct([&*options.state], &[&options.outfile])?;
    Ok(())
}

/// Returns the samples that each pixel is to have.
///
/// # Errors
/// No more samples than there are; statistics that the filter lacks; a filter that fails.
fn allocate(options: &AllocateOptions, state: RenderState) -> Result<Vec<u32>, Failure> {
    let RenderState { settings, checkpoint, .. } = state;
    let store = checkpoint.store.clone();
    let taken = store.next_indices();
    let total = u64::from(options.spp) * store.pixels() as u64;
    let left = total.saturating_sub(store.samples_taken());
    if left == 0 || options.spp > MOST_SAMPLES {
        let has = store.samples_taken() as f64 / store.pixels().max(1) as f64;
        return Err(Failure::Input(anyhow!(
            "--spp {}: accepted is more than the {has:.1} samples per pixel of {}, up to {MOST_SAMPLES}",
            options.spp,
            options.state.display()
        )));
    }
    // Shards are often rendered unfiltered: their own denoiser is not asked.
    let denoiser = options.denoiser.choose(DEFAULT.stand_in()).map_err(Failure::Input)?;
    let settings = Settings {
        denoiser,
        sampling: Sampling::Adaptive,
        sample_map: None,
        // That of the renders before need not hold for the next
        max_spp: NO_CEILING,
        ..settings
    };
    let filtered = filter(&checkpoint, &settings)?;
    let more = allocate_after(checkpoint, filtered, &settings, left);
    Ok(taken.iter().zip(more).map(|(taken, more)| (taken + more).min(MOST_SAMPLES)).collect())
}

fn write(path: &Path, [width, height]: [usize; 2], counts: &[u32]) -> Result<(), Failure> {
    let values: Vec<f32> = counts.iter().map(|&count| count as f32).collect();
    let channel = Channel::new("SampleCount.X", &values, Precision::Float);
    let written = exr_file::write(path, Windows::whole(width, height), &[channel], &[]);
    written.map_err(|error| Failure::Run(error.into()))
}
