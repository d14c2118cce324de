//! The processes of a program that `mpirun` or `srun` has started: their start, their agreement on the inputs, their end.
//!
//! Every process reads the inputs by itself. Before the render begins they agree: all have read the same, or all end with
//! the error of the first one that failed, which one process prints.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use mpi::Threading;
use mpi::environment::Universe;
use serde::{Deserialize, Serialize};

use super::coordinator::Coordinator;
use super::link::Link;
use super::partition::TileCosts;
use super::watch::{Neighbour, watch, watched_by};
use super::{command::Command, worker};
use crate::progressive::ProcessGroup;
use crate::render::Renderer;

/// Exit status of a job whose processes cannot go on.
const FAILED: i32 = 1;
/// Time that a launcher has to end the job after one of its processes.
const PATIENCE: Duration = Duration::from_secs(5);

/// This process among those that render one image together.
pub struct Processes {
    link: Link,
    has_agreed: AtomicBool,
    has_ended: Arc<AtomicBool>,
    // Ends MPI when it is dropped.
    _universe: Universe,
}

/// The inputs of a process, or why it has none.
#[derive(Serialize, Deserialize)]
struct Inputs {
    values: Vec<(String, String)>,
    error: Option<String>,
    host: String,
}

impl Processes {
    /// Joins the other processes. `None` if the program was started alone. `print` prints the line about a process on this
    /// machine that was killed.
    ///
    /// # Errors
    /// One line: an MPI library that several threads may not use.
    pub fn start(print: fn(&str)) -> Result<Option<Self>, String> {
        // A program that no launcher has started needs nothing of MPI.
        if !["OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"]
            .iter()
            .any(|name| std::env::var_os(name).is_some())
        {
            return Ok(None);
        }
        let Some((universe, provided)) = mpi::initialize_with_threading(Threading::Serialized) else {
            return Err("MPI has been started before".to_owned());
        };
        if provided < Threading::Serialized {
            return Err(format!("MPI: found threading {provided:?}; accepted is Serialized or Multiple"));
        }
        let link = Link::default();
        if link.size() == 1 {
            return Ok(None);
        }
        let has_ended = Arc::new(AtomicBool::new(false));
        watch(neighbours(&link), has_ended.clone(), move |Neighbour { rank, host, .. }| {
            print(&format!(
                "prpf: process {rank} on {host} has ended before the render, which can go on from a file of --state"
            ));
            // No launcher has ended the job
            std::thread::sleep(PATIENCE);
            std::process::exit(FAILED);
        });
        Ok(Some(Self { link, has_agreed: AtomicBool::new(false), has_ended, _universe: universe }))
    }

    /// Returns whether this is the first process, which decides and prints.
    pub fn is_first(&self) -> bool {
        self.link.rank() == 0
    }

    /// Returns the number of processes.
    pub fn count(&self) -> usize {
        self.link.size()
    }

    /// Waits for the inputs of all processes: values that have to be the same in all, with their names, or an error. Called
    /// once by each.
    ///
    /// # Errors
    /// A process has failed, or has other inputs; the same line in all processes.
    pub fn agree(&self, values: Vec<(String, String)>, error: Option<String>) -> Result<(), String> {
        self.has_agreed.store(true, Ordering::Relaxed);
        let own = Inputs { values, error, host: host() };
        if !self.is_first() {
            self.link.tell(0, &own);
            return self.link.hear::<Option<String>>(0).map_or(Ok(()), Err);
        }
        let others: Vec<Inputs> = (1..self.count()).map(|rank| self.link.hear(rank)).collect();
        let error = disagreement(&own, &others);
        (1..self.count()).for_each(|rank| self.link.tell(rank, &error));
        error.map_or(Ok(()), Err)
    }

    /// Returns whether [`Self::agree`] has been called.
    pub fn has_agreed(&self) -> bool {
        self.has_agreed.load(Ordering::Relaxed)
    }

    /// Checks that each process can get pixels of an image of this size.
    ///
    /// # Errors
    /// One line.
    pub fn check_size(&self, (width, height): (usize, usize)) -> Result<(), String> {
        let most = TileCosts::uniform(width, height, 1.0).len();
        if self.count() <= most {
            return Ok(());
        }
        Err(format!(
            "found {} processes for {width}x{height} pixels; accepted are at most {most}, one for each tile of 16x16",
            self.count()
        ))
    }

    /// Returns the group with which the first process renders. `renderer` renders the whole image, into a store with
    /// reservoirs of `capacity` sample vectors and this seed. A signal to any process sets `interrupt`.
    pub fn coordinator<'s>(
        &'s self,
        renderer: &Renderer<'s>,
        (capacity, seed): (usize, u64),
        interrupt: &'s AtomicBool,
    ) -> Box<dyn ProcessGroup + 's> {
        Box::new(Coordinator::new(&self.link, renderer, (capacity, seed), interrupt))
    }

    /// Serves the first process until it ends.
    pub fn serve(&self, renderer: &Renderer, interrupt: &AtomicBool) {
        worker::serve(&self.link, renderer, interrupt);
    }

    /// Ends, in the first process all others as well.
    pub fn end(&self) {
        self.has_ended.store(true, Ordering::Relaxed);
        if self.is_first() && self.has_agreed() {
            (1..self.count()).for_each(|rank| self.link.tell(rank, &Command::End));
        }
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        use mpi::traits::Communicator;
        if !self.has_ended.load(Ordering::Relaxed) {
            // A panic: the others would wait for ever.
            mpi::topology::SimpleCommunicator::world().abort(FAILED);
        }
    }
}

/// Returns the name of this machine.
pub(super) fn host() -> String {
    mpi::environment::processor_name().unwrap_or_default()
}

/// Returns whom this process watches.
fn neighbours(link: &Link) -> Vec<Neighbour> {
    let own = Neighbour::own(link.rank(), host());
    if link.rank() > 0 {
        link.tell(0, &own);
        return link.hear(0);
    }
    let all: Vec<Neighbour> =
        std::iter::once(own).chain((1..link.size()).map(|rank| link.hear(rank))).collect();
    (1..link.size()).for_each(|rank| link.tell(rank, &watched_by(rank, &all)));
    watched_by(0, &all)
}

/// Returns the first error of a process, or the first difference from the inputs of the first process.
fn disagreement(first: &Inputs, others: &[Inputs]) -> Option<String> {
    if let Some(error) = &first.error {
        return Some(error.clone());
    }
    others.iter().enumerate().find_map(|(i, other)| {
        let process = format!("process {} on {}", i + 1, other.host);
        if let Some(error) = &other.error {
            return Some(format!("{process}: {error}"));
        }
        let value = |inputs: &Inputs, name: &String| {
            inputs
                .values
                .iter()
                .find(|(other, _)| other == name)
                .map_or("none".to_owned(), |(_, value)| value.clone())
        };
        let differs = |name: &String| {
            let (wanted, found) = (value(first, name), value(other, name));
            (wanted != found).then(|| {
                format!(
                    "{process}: found {name} {found}; accepted is that of process 0 on {}, {wanted}",
                    first.host
                )
            })
        };
        first.values.iter().chain(&other.values).map(|(name, _)| name).find_map(differs)
    })
}
