//! Notices that another process on this machine has ended before the job, for instance by `kill -9`.
//!
//! MPI lets the others wait for it, and a launcher says it in its own words or, as `mpirun -q`, not at all. On each machine the first
//! process watches the others there, and the second one the first, so that one of them notices. A process that is alone on its
//! machine is not watched. Only Linux tells whether a process lives.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(50);

/// Time from a death to the word about it: a launcher that kills the whole job, one process after another, kills this one as
/// well by then. Open MPI waits for a second before it kills the others of one that has died.
const DOUBT: Duration = Duration::from_millis(300);

/// A process that can be watched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Neighbour {
    pub rank: usize,
    pub host: String,
    /// Its number, and when it started, in the clock ticks of its machine: numbers are given again.
    lifetime: Option<(u32, u64)>,
}

impl Neighbour {
    /// Returns this process.
    pub fn own(rank: usize, host: String) -> Self {
        let pid = std::process::id();
        Self { rank, host, lifetime: start_of(pid).ok().flatten().map(|start| (pid, start)) }
    }

    fn lives(&self) -> bool {
        // A look that failed says nothing about the process.
        self.lifetime.is_some_and(|(pid, start)| start_of(pid).map_or(true, |found| found == Some(start)))
    }
}

/// Returns when a process started; `None` if it has ended.
///
/// # Errors
/// Those of a look that fails, for instance because this process has too many open files.
fn start_of(pid: u32) -> io::Result<Option<u64>> {
    match std::fs::read_to_string(format!("/proc/{pid}/stat")) {
        Ok(text) => Ok(parse_start(&text)),
        Err(error) if is_no_process(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Returns whether an error of reading a process's file means that the process has ended, before or after the file was opened.
fn is_no_process(error: &io::Error) -> bool {
    /// "No such process"
    const ESRCH: i32 = 3;
    error.kind() == io::ErrorKind::NotFound || error.raw_os_error() == Some(ESRCH)
}

/// Returns when a process started, by its file of `/proc`; `None` if it has ended and its parent has not taken notice yet.
fn parse_start(text: &str) -> Option<u64> {
    // The second field, a name in parentheses, may contain anything; the third is the state, the 22nd the start.
    let mut fields = text.rsplit_once(')')?.1.split_whitespace();
    let state = fields.next()?;
    let start = fields.nth(18)?.parse().ok()?;
    (!matches!(state, "Z" | "X")).then_some(start)
}

/// Returns whom the process of a rank watches. `all` are in the order of their ranks.
pub fn watched_by(rank: usize, all: &[Neighbour]) -> Vec<Neighbour> {
    let here: Vec<&Neighbour> = all.iter().filter(|other| other.host == all[rank].host).collect();
    let watched = match here.iter().position(|process| process.rank == rank) {
        Some(0) => &here[1..],
        Some(1) => &here[..1],
        _ => &[],
    };
    watched.iter().copied().cloned().collect()
}

/// Watches processes on a thread of its own until `has_ended`, and calls `lost` with one that ends earlier, a moment later.
pub fn watch(
    processes: Vec<Neighbour>,
    has_ended: Arc<AtomicBool>,
    lost: impl FnOnce(&Neighbour) + Send + 'static,
) {
    // Those of another container with this machine's name cannot be seen.
    let processes: Vec<Neighbour> = processes.into_iter().filter(Neighbour::lives).collect();
    if processes.is_empty() {
        return;
    }
    std::thread::spawn(move || {
        loop {
            let dead = processes.iter().find(|process| !process.lives());
            std::thread::sleep(if dead.is_some() { DOUBT } else { PERIOD });
            if has_ended.load(Ordering::Relaxed) {
                return;
            }
            if let Some(dead) = dead {
                return lost(dead);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_on_a_machine_watches_and_is_watched() {
        let hosts = ["a", "a", "b", "a", "b", "c"];
        let all: Vec<Neighbour> =
            hosts.iter().enumerate().map(|(rank, host)| Neighbour::own(rank, (*host).to_owned())).collect();
        let watched = |rank| watched_by(rank, &all).iter().map(|process| process.rank).collect::<Vec<_>>();
        let expected = [vec![1, 3], vec![0], vec![4], vec![], vec![2], vec![]];
        assert_eq!([0, 1, 2, 3, 4, 5].map(watched), expected);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_killed_process_is_noticed_until_the_end() {
        for ends in [false, true] {
            let mut children = [0, 1].map(|_| std::process::Command::new("sleep").arg("60").spawn().unwrap());
            let watched = children.each_ref().map(|child| {
                let lifetime = Some((child.id(), start_of(child.id()).unwrap().unwrap()));
                Neighbour { rank: child.id() as usize, host: String::new(), lifetime }
            });
            let (has_ended, (sender, receiver)) =
                (Arc::new(AtomicBool::new(false)), std::sync::mpsc::channel());
            watch(watched.into(), has_ended.clone(), move |dead| sender.send(dead.rank).unwrap());
            has_ended.store(ends, Ordering::Relaxed);
            // Not waited for, it is a zombie
            children[1].kill().unwrap();
            assert_eq!(receiver.recv().ok(), (!ends).then_some(children[1].id() as usize));
            children[0].kill().unwrap();
            children.iter_mut().for_each(|child| drop(child.wait()));
        }
    }

    #[test]
    fn only_a_process_that_is_not_there_has_ended() {
        let errors = [2, 3, 13, 24].map(io::Error::from_raw_os_error);
        // ENOENT and ESRCH, but not EACCES and EMFILE
        assert_eq!(errors.each_ref().map(is_no_process), [true, true, false, false]);
    }

    #[test]
    fn another_process_with_the_same_number_is_another() {
        let own = Neighbour::own(0, String::new());
        let Some((pid, start)) = own.lifetime else { return };
        assert!(own.lives());
        assert!(!Neighbour { lifetime: Some((pid, start + 1)), ..own }.lives());
    }
}
