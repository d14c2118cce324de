//! The command line: arguments → settings → loop → report.
//!
//! Exit status: 0 done; 1 the render failed (or an image is farther from its reference than asked);
//! 2 the command line or an input file is wrong; 130 stopped by a person, image and state written
//! (a preview that is closed has nothing to write, and is done: 0).

mod compare;
mod denoise;
mod export;
mod info;
mod layers;
mod merge;
mod options;
mod output;
mod preview;
mod render;
mod report;
mod signals;
mod state;
mod summary;
mod usage;

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
    /// Render a scene; write the image and say what was achieved
    Render(Box<options::RenderOptions>),
    /// Render live: a page to look at the image as it converges, and to steer it
    Preview(Box<preview::PreviewOptions>),
    /// Filter a render's state again, with other settings, without tracing a ray
    Denoise(denoise::DenoiseOptions),
    /// Add states of one picture: other seeds, other shards
    Merge(merge::MergeOptions),
    /// Write all that a state holds as named numpy arrays
    Export(export::ExportOptions),
    /// Show what a scene holds, the effects it calls for, and the dimensions of its sample vector
    Info(info::InfoOptions),
    /// Compare an image with a reference: MSE, relMSE, PSNR, SSIM, FLIP, brightness
    Compare(compare::CompareArgs),
}

/// Prints to standard output. Nobody listening any more, as after `| head`, is no failure.
fn say(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Prints a line to standard error, if that goes anywhere.
fn complain(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// One line that a terminal can show: what is no printable character is escaped, and the middle of
/// what is too long left out.
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

/// Something that went wrong, and the exit status it ends in.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line or an input file: 2.
    Input(anyhow::Error),
    /// Everything else: 1.
    Run(anyhow::Error),
}

/// More threads than this are a slip of the finger, and would take the machine down.
const MOST_THREADS: usize = 1024;

/// What `--threads` accepts.
fn parse_threads(text: &str) -> Result<NonZeroUsize, String> {
    match text.parse::<NonZeroUsize>() {
        Ok(n) if n.get() <= MOST_THREADS => Ok(n),
        _ => Err(format!("found `{text}`; accepted are whole numbers from 1 to {MOST_THREADS}")),
    }
}

/// Runs something on so many worker threads; on all cores if nothing is said.
fn in_pool<T: Send>(
    threads: Option<NonZeroUsize>,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    // No number is 0, which stands for all cores.
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
            complain(&format!("prpf: {}", usage::one_line(&error)));
            return ExitCode::from(2);
        }
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    let outcome = match arguments.command {
        Command::Render(options) => render::run(&options, render::Mode::Render, start),
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
            complain(&format!("prpf: {}", escaped(&format!("{error:#}"))));
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
