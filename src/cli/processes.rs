//! The processes that `mpirun` or `srun` has started to render one image together, in a program with the feature `mpi`.
//!
//! The first one prints, reads states and writes all outputs; the others follow it.

use super::failure::Failure;
use super::mode::Mode;
use super::options::RenderOptions;
use super::state_options::StateOptions;
use super::terminal::print_error;
use crate::filter::UNFILTERED;
use crate::filter::learned::weights_id;
use crate::progressive::Settings;
use crate::render::Shard;
use crate::state::ImageMetadata;

#[cfg(feature = "mpi")]
pub(super) use crate::distributed::Processes;
#[cfg(not(feature = "mpi"))]
pub(super) use alone::Processes;

/// Joins the other processes; `None` if there are none.
pub(super) fn start() -> Result<Option<Processes>, Failure> {
    Processes::start(print_error).map_err(|error| Failure::Run(anyhow::Error::msg(error)))
}

/// Ends the job because of this process's arguments; the first process prints the failure.
pub(super) fn refuse(failure: Failure) -> Result<u8, Failure> {
    match start()? {
        Some(processes) => finish(&processes, Err(failure)),
        None => Err(failure),
    }
}

/// Returns an error if a launcher has started several processes that do not see each other, which would all render the same,
/// and whether this is the first of them. Shards are not the same.
pub(super) fn launched_apart(options: &RenderOptions) -> Option<(anyhow::Error, bool)> {
    let number = |name| std::env::var(name).ok()?.parse::<usize>().ok();
    // Slurm may have started programs without MPI for anything else
    let is_slurm = number("SLURM_PROCID").is_some();
    let launchers = [
        ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK", true),
        ("PMI_SIZE", "PMI_RANK", !is_slurm),
        ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID", cfg!(feature = "mpi")),
    ];
    let mut known = launchers.into_iter().filter(|launcher| launcher.2);
    let (count, rank) = known.find_map(|(size, rank, _)| Some((number(size)?, number(rank)?)))?;
    let reason = if cfg!(feature = "mpi") {
        "that the MPI library sees as one; accepted is the launcher of the library that the program was built with, or `srun` with the right `--mpi`"
    } else {
        "of a program built without the feature `mpi`; accepted is one, or one with the feature"
    };
    let error = anyhow::anyhow!("found {count} processes {reason}");
    (count > 1 && options.state.shard == Shard::WHOLE).then_some((error, rank == 0))
}

/// Checks that several processes can render as the options ask for.
///
/// # Errors
/// An option that needs one process.
pub(super) fn check(processes: &Processes, options: &RenderOptions, mode: Mode) -> anyhow::Result<()> {
    let refused = [
        ("preview", mode == Mode::Preview),
        ("--preview", options.preview.is_some()),
        ("--display-server", options.display_server.is_some()),
        ("--samples", options.samples.is_some()),
        ("--debug-sample", options.debug_sample.is_some()),
    ];
    match refused.into_iter().find(|(_, is_given)| *is_given) {
        Some((name, _)) => {
            anyhow::bail!("{name}: found with {} processes; accepted is a single one", processes.count())
        }
        None => Ok(()),
    }
}

/// Returns the options of a process other than the first: it prints, reads and writes nothing but the scene.
pub(super) fn follower_options(options: &RenderOptions) -> RenderOptions {
    RenderOptions {
        report: None,
        reference: None,
        state: StateOptions { state: None, resume: false, ..options.state.clone() },
        quiet: true,
        ..options.clone()
    }
}

/// Waits until all processes have read the same inputs.
///
/// # Errors
/// Those of the first process that has others, or none; too many processes for the image.
pub(super) fn agree(
    processes: &Processes,
    options: &RenderOptions,
    metadata: &ImageMetadata,
    settings: &Settings,
) -> Result<(), Failure> {
    let [width, height] = metadata.resolution().unwrap_or_default();
    let checked = processes.check_size((width, height));
    // The first process chooses the denoiser, by its own memory and threads, and is the only one that needs it
    let settings = Settings { denoiser: UNFILTERED, ..settings.clone() };
    let values = [
        ("program", program()),
        ("scene", format!("{} ({:.12})", metadata.source, metadata.hash)),
        ("weights of the denoiser learned", weights_id().to_owned()),
        ("shard", options.state.shard.to_string()),
    ];
    let mut values: Vec<_> = values.map(|(name, value)| (name.to_owned(), value)).into();
    values.extend(fields(metadata).chain(fields(&settings)));
    processes.agree(values, checked.err()).map_err(|error| Failure::Input(anyhow::Error::msg(error)))
}

/// Returns the fields of a structure, each with its name, as text.
fn fields(structure: &impl serde::Serialize) -> impl Iterator<Item = (String, String)> {
    let fields = match serde_json::to_value(structure) {
        Ok(serde_json::Value::Object(fields)) => fields,
        _ => Default::default(),
    };
    fields.into_iter().map(|(name, value)| (name, value.to_string()))
}

/// Returns version and hash of the program.
fn program() -> String {
    use sha2::{Digest, Sha256};
    let bytes = std::env::current_exe().and_then(std::fs::read).unwrap_or_default();
    let hash = Sha256::digest(bytes).iter().take(6).map(|byte| format!("{byte:02x}")).collect::<String>();
    format!("{} ({hash})", env!("CARGO_PKG_VERSION"))
}

/// Ends this process's part of a command, in the first process the whole job. Returns the command's result in the first
/// process, success in others: a launcher stops the whole job as soon as one process ends without success, and the first
/// one has a line to print then.
pub(super) fn finish(processes: &Processes, result: Result<u8, Failure>) -> Result<u8, Failure> {
    if let (Err(failure), false) = (&result, processes.has_agreed()) {
        // The others wait for this process's inputs; the first one prints the error.
        let _ = processes.agree(Vec::new(), Some(format!("{:#}", failure.error())));
    }
    processes.end();
    if processes.is_first() { result } else { Ok(0) }
}

/// A program without MPI.
#[cfg(not(feature = "mpi"))]
mod alone {
    use std::sync::atomic::AtomicBool;

    use crate::progressive::ProcessGroup;
    use crate::render::Renderer;

    /// More than one process, which there never is.
    pub enum Processes {}

    impl Processes {
        pub fn start(_: fn(&str)) -> Result<Option<Self>, String> {
            Ok(None)
        }

        pub fn is_first(&self) -> bool {
            match *self {}
        }

        pub fn count(&self) -> usize {
            match *self {}
        }

        pub fn has_agreed(&self) -> bool {
            match *self {}
        }

        pub fn agree(&self, _: Vec<(String, String)>, _: Option<String>) -> Result<(), String> {
            match *self {}
        }

        pub fn check_size(&self, _: (usize, usize)) -> Result<(), String> {
            match *self {}
        }

        pub fn coordinator<'s>(
            &'s self,
            _: &Renderer<'s>,
            _: (usize, u64),
            _: &'s AtomicBool,
        ) -> Box<dyn ProcessGroup + 's> {
            match *self {}
        }

        pub fn serve(&self, _: &Renderer, _: &AtomicBool) {
            match *self {}
        }

        pub fn end(&self) {
            match *self {}
        }
    }
}
