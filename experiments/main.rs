//! `prpf-experiments`: asks the library questions and writes the answers down.
//!
//! An experiment is a module with a function that takes a [`Bench`], and a line in [`EXPERIMENTS`].
//! What it runs stands in `experiments/NAME.toml`; it leaves a report, plots, pictures and every
//! measurement in `experiments/results/NAME/`. It uses only the library's public face.

mod accuracy;
mod allocation;
mod bench;
mod curves;
mod effects;
mod ledger;
mod paper;
mod picture;
mod plot;
mod reference;
mod report;
mod sampling;
mod scenes;
mod settings;
mod stability;
mod statistics;
mod trial;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;

use bench::Bench;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// What runs an experiment.
type Run = fn(&mut Bench) -> anyhow::Result<()>;

/// Every experiment by its name.
const EXPERIMENTS: &[(&str, Run)] = &[
    ("paper", paper::run),
    ("allocation", allocation::run),
    ("accuracy", accuracy::run),
    ("effects", effects::run),
    ("stability", stability::run),
];

/// Runs an experiment and writes its report.
#[derive(Parser)]
#[command(after_help = "\
What an experiment runs stands in experiments/NAME.toml. It can be stopped at any time: the next run goes
on where it was. Call it in the repository's folder.")]
struct Arguments {
    /// Which experiment
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(EXPERIMENTS.iter().map(|(name, _)| *name)))]
    name: String,
    /// A small variant, of minutes
    #[arg(long)]
    quick: bool,
    /// Folder of the results [default: experiments/results/NAME, with --quick NAME-quick]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of public scenes; those that are not there are left out [default: $PRPF_SCENES]
    #[arg(long, value_name = "DIR")]
    scenes_dir: Option<PathBuf>,
    /// Measure everything again
    #[arg(long)]
    fresh: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("prpf-experiments: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> anyhow::Result<()> {
    let Arguments { name, quick, out, scenes_dir, fresh } = arguments;
    let scenes_dir = scenes_dir.or_else(|| std::env::var_os("PRPF_SCENES").map(PathBuf::from));
    let mut bench = Bench::new(&name, quick, out, scenes_dir, fresh)?;
    let (_, run) = EXPERIMENTS.iter().find(|(known, _)| *known == name).expect("the parser knows the names");
    run(&mut bench)?;
    bench.finish()
}
