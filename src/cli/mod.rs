//! The command line: arguments → settings → loop → report.
//!
//! Exit status: 0 done; 1 the render failed (or an image is farther from its reference than asked);
//! 2 the command line or an input file is wrong; 130 interrupted by SIGINT, SIGTERM or SIGHUP, image and state written
//! (a preview that is closed has nothing to write, and is done: 0).

mod checkpoints;
mod compare;
mod debug_sample;
mod denoise;
mod denoiser_options;
mod export;
mod host;
mod info;
mod inputs;
mod merge;
mod mode;
mod options;
mod output_paths;
mod parse;
mod preview;
mod render;
mod signals;
mod state_options;
mod summary;
mod usage;
mod viewers;

use std::ffi::OsString;
use std::io::Write;
use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context;
use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

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
    /// Write the content of a state as named numpy arrays
    Export(export::ExportOptions),
    /// Show what a scene holds, the effects it calls for, and the dimensions of its sample vector
    Info(info::InfoOptions),
    /// Compare an image with a reference: MSE, relMSE, PSNR, SSIM, FLIP, brightness
    Compare(compare::CompareArgs),
}

/// Prints to standard output. A closed pipe, as after `| head`, is no failure.
fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Prints a line to standard error, if that is open.
fn print_error(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Returns one line that a terminal can show: control characters are escaped, and the middle of a long text is left out.
fn escaped(text: &str) -> String {
    /// Characters shown of a message; of the longest file names there is enough to recognise them.
    const LONGEST: usize = 1000;
    let printable = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    let line: Vec<char> = text.chars().flat_map(|c| printable(c).chars().collect::<Vec<_>>()).collect();
    if line.len() <= LONGEST {
        return line.into_iter().collect();
    }
    let (start, end) = (&line[..LONGEST / 2], &line[line.len() - LONGEST / 2..]);
    start.iter().chain(&['.', '.', '.']).chain(end).collect()
}

/// Returns the command line of this process.
fn command_line() -> String {
    let words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    words.join(" ")
}

/// An error, with the exit status that it leads to.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line or an input file: 2.
    Input(anyhow::Error),
    /// Everything else: 1.
    Run(anyhow::Error),
}

/// Runs `work` on `threads` worker threads; on all cores by default.
fn in_pool<T: Send>(
    threads: Option<NonZeroUsize>,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    // 0 lets rayon use all cores.
    let threads = threads.map_or(0, NonZeroUsize::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.context("starting the worker threads").map_err(Failure::Run)?.install(work)
}

/// Runs the program; `start` is when it started, which is what time budgets count from.
pub fn run(arguments: impl IntoIterator<Item = OsString>, start: Instant) -> ExitCode {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error)
            if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand =>
        {
            print_error(&format!("prpf: {}", usage::one_line(&error)));
            return ExitCode::from(2);
        }
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    let outcome = match arguments.command {
        Command::Render(options) => render::run(&options, mode::Mode::Render, start),
        Command::Preview(options) => preview::run(&options, start),
        Command::Denoise(options) => denoise::run(&options, start),
        Command::Merge(options) => merge::run(&options),
        Command::Export(options) => export::run(&options),
        Command::Info(options) => info::run(&options),
        Command::Compare(options) => compare::run(&options).map_err(Failure::Input),
    };
    match outcome {
        Ok(status) => ExitCode::from(status),
        Err(failure) => {
            let (error, status) = match failure {
                Failure::Input(error) => (error, 2),
                Failure::Run(error) => (error, 1),
            };
            print_error(&format!("prpf: {}", escaped(&format!("{error:#}"))));
            ExitCode::from(status)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_one_printable_line_of_bounded_length() {
        assert_eq!(escaped("a\u{1b}[2Jb\nc é"), "a\\u{1b}[2Jb\\nc é");
        let long = escaped(&"x".repeat(5000));
        assert!(long.len() < 1010 && long.contains("..."));
    }
}
