//! `prpf-experiments`: measures the library and writes reports.
//!
//! An experiment is a module with a function that takes a [`Session`], and an entry of [`EXPERIMENTS`].
//! `experiments/NAME.toml` holds its settings; `experiments/results/NAME/` receives its report, plots, pictures
//! and measurements. Experiments use the library's public interface only.

mod accuracy;
mod allocation;
mod configuration;
mod curves;
mod effects;
mod estimate_check;
mod filters;
mod ledger;
mod paper;
mod peers;
mod picture;
mod plot;
mod reference;
mod report;
mod sampling;
mod scenes;
mod session;
mod settings;
mod stability;
mod statistics;
mod test_scene;
mod trial;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;

use ledger::Earlier;
use session::Session;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Runs an experiment.
type Run = fn(&mut Session) -> anyhow::Result<()>;

/// All experiments, by name.
const EXPERIMENTS: &[(&str, Run)] = &[
    ("paper", paper::run),
    ("allocation", allocation::run),
    ("accuracy", accuracy::run),
    ("filters", filters::run),
    ("effects", effects::run),
    ("stability", stability::run),
];

/// Name of the comparison of given images, which measures nothing of its own.
const PEERS: &str = "peers";

fn names() -> impl Iterator<Item = &'static str> {
    EXPERIMENTS.iter().map(|(name, _)| *name).chain([PEERS])
}

/// Runs an experiment and writes its report.
#[derive(Parser)]
#[command(after_help = "\
  prpf-experiments filters --quick
  prpf-experiments peers FOLDER      one HTML page of the images FOLDER/SCENE/*.exr and .png beside reference.exr

experiments/NAME.toml holds an experiment's settings. A run can be stopped at any time: the next one continues
it. Run it in the repository's folder.")]
struct Arguments {
    /// Name of the experiment, or `peers`
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(names()))]
    name: String,
    /// Of `peers`: the folder with a folder of images for each scene, which gets the page
    #[arg(required_if_eq("name", PEERS))]
    folder: Option<PathBuf>,
    /// Run a smaller variant, which takes minutes
    #[arg(long)]
    quick: bool,
    /// Folder of the results [default: experiments/results/NAME, with --quick NAME-quick]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of the public scenes; missing ones are left out [default: $PRPF_SCENES]
    #[arg(long, value_name = "DIR")]
    scenes_dir: Option<PathBuf>,
    /// Discard earlier measurements
    #[arg(long)]
    fresh: bool,
    /// Measure nothing: write the report of the measurements in the results' data.csv, whatever their commit
    #[arg(long, conflicts_with = "fresh")]
    report_only: bool,
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
    let Arguments { name, folder, quick, out, scenes_dir, fresh, report_only } = arguments;
    if let Some(folder) = &folder {
        anyhow::ensure!(name == PEERS, "{}: found a folder; accepted with {PEERS} only", folder.display());
        println!("{}", peers::write_page(folder)?.display());
        return Ok(());
    }
    let scenes_dir = scenes_dir.or_else(|| std::env::var_os("PRPF_SCENES").map(PathBuf::from));
    let earlier = match (fresh, report_only) {
        (true, _) => Earlier::Discard,
        (_, true) => Earlier::Only,
        _ => Earlier::Continue,
    };
    let mut session = Session::new(&name, quick, out, scenes_dir, earlier)?;
    let (_, run) = EXPERIMENTS.iter().find(|(known, _)| *known == name).expect("the parser knows the names");
    run(&mut session)?;
    session.finish()
}
