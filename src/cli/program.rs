//! The program: which commands there are, and the exit status of each outcome.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::Instant;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

use super::failure::Failure;
use super::mode::Mode;
use super::terminal::{escaped, print_error};
use super::{allocate, compare, denoise, export, info, merge, options, preview, processes, render, usage};

#[derive(Parser)]
#[command(
    name = "prpf",
    version,
    about = "Progressive path tracer whose adaptive sampling is coupled to its denoiser (P-RPF)",
    before_help = "Try: prpf render scenes/pool/pool.pbrt -o pool.png --spp 16",
    arg_required_else_help = true,
    disable_help_subcommand = true
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene; write the image and print a summary
    Render(Box<options::RenderOptions>),
    /// Render live: serve a page that shows the image as it converges, and steers it
    Preview(Box<preview::PreviewOptions>),
    /// Filter a render's state again, with another denoiser, without tracing a ray
    Denoise(denoise::DenoiseOptions),
    /// Add states of one scene: other seeds, other shards
    Merge(merge::MergeOptions),
    /// Decide how many samples each pixel of a state is to have next
    Allocate(allocate::AllocateOptions),
    /// Write the content of a state as named numpy arrays
    Export(export::ExportOptions),
    /// Show what a scene holds, the effects it calls for, and the dimensions of its sample vector
    Info(info::InfoOptions),
    /// Compare an image with a reference: MSE, relMSE, PSNR, SSIM, FLIP, brightness
    Compare(compare::CompareOptions),
}

/// Runs the program; `start` is when it started, which is what time budgets count from.
pub fn run(arguments: impl IntoIterator<Item = OsString>, start: Instant) -> ExitCode {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let outcome = match Arguments::try_parse_from(&arguments) {
        Ok(Arguments { command }) => perform(command, start),
        Err(error)
            if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand =>
        {
            let failure = Failure::Input(anyhow::Error::msg(usage::one_line(&error)));
            let renders = arguments.get(1).is_some_and(|command| command == "render" || command == "preview");
            if renders { processes::refuse(failure) } else { Err(failure) }
        }
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    match outcome {
        Ok(status) => ExitCode::from(status),
        Err(failure) => {
            print_error(&format!("prpf: {}", escaped(&format!("{:#}", failure.error()))));
            ExitCode::from(failure.status())
        }
    }
}

fn perform(command: Command, start: Instant) -> Result<u8, Failure> {
    match command {
        Command::Render(options) => render::run(&options, Mode::Render, start),
        Command::Preview(options) => preview::run(&options, start),
        Command::Denoise(options) => denoise::run(&options, start),
        Command::Merge(options) => merge::run(&options),
        Command::Allocate(options) => allocate::run(&options),
        Command::Export(options) => export::run(&options),
        Command::Info(options) => info::run(&options),
        Command::Compare(options) => compare::run(&options).map_err(Failure::Input),
    }
}
