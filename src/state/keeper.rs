//! Gets states to the disk while the render goes on: what is known is copied, which takes a moment, and
//! a thread of its own writes it, which takes as long as the disk takes.

use std::io;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Mutex, MutexGuard};
use std::thread::JoinHandle;

use super::{State, bytes};
use crate::files::ExclusiveFile;

const ENDED_EARLY: &str = "the thread that writes states ended early";

/// See the module.
pub struct Keeper {
    to_write: Sender<Vec<u8>>,
    /// What was written, to be filled again, and how that went.
    written: Mutex<Receiver<(Vec<u8>, io::Result<()>)>>,
    state: Mutex<Progress>,
    thread: JoinHandle<()>,
}

#[derive(Default)]
struct Progress {
    /// The one buffer, when it is not being written.
    buffer: Option<Vec<u8>>,
    /// How the latest writing ended, and whether nobody has asked since.
    latest: Option<Result<(), String>>,
    is_news: bool,
}

impl Keeper {
    /// Will keep states in this file.
    ///
    /// # Errors
    /// A file that cannot be written or that another program keeps, or a disk without room for so many bytes: known
    /// before any work.
    pub fn new(path: &Path, size: usize) -> io::Result<Self> {
        let mut own = ExclusiveFile::new(path)?;
        own.check_space(size)?;
        let (to_write, jobs) = channel::<Vec<u8>>();
        let (done, written) = channel();
        let thread = std::thread::Builder::new().name("state".into()).spawn(move || {
            for file in jobs {
                let result = own.replace(&file);
                if done.send((file, result)).is_err() {
                    return;
                }
            }
        })?;
        let state = Mutex::new(Progress { buffer: Some(Vec::new()), ..Progress::default() });
        Ok(Self { to_write, written: Mutex::new(written), state, thread })
    }

    /// Has a state written, after the one that is being written.
    pub fn keep(&self, state: &State) {
        let mut progress = self.progress(true);
        let mut file = progress.buffer.take().unwrap_or_default();
        bytes(state, &mut file);
        // Fails only if the thread is gone, which `finish` reports.
        let _ = self.to_write.send(file);
    }

    /// How the latest writing that has ended did so, if nobody has asked since.
    pub fn news(&self) -> Option<Result<(), String>> {
        let mut progress = self.progress(false);
        std::mem::take(&mut progress.is_news).then(|| progress.latest.clone()).flatten()
    }

    /// Waits until all is written.
    ///
    /// # Errors
    /// What the file system said to the last state.
    pub fn settle(&self) -> Result<(), String> {
        self.progress(true).latest.clone().unwrap_or(Ok(()))
    }

    /// Waits until all is written.
    ///
    /// # Errors
    /// What the file system said to the last state.
    pub fn finish(self) -> Result<(), String> {
        let result = self.settle();
        drop(self.to_write);
        self.thread.join().map_err(|_| ENDED_EARLY.to_owned())?;
        result
    }

    /// How far it is; if it `waits`, when nothing is being written.
    fn progress(&self, waits: bool) -> MutexGuard<'_, Progress> {
        let mut progress = self.state.lock().expect("no thread panics while it holds this");
        if progress.buffer.is_none() {
            let written = self.written.lock().expect("no thread panics while it holds this");
            let ended = if waits {
                written.recv().map_err(|_| TryRecvError::Disconnected)
            } else {
                written.try_recv()
            };
            let (buffer, result) = match ended {
                Ok((buffer, result)) => (buffer, result.map_err(|error| error.to_string())),
                Err(TryRecvError::Empty) => {
                    drop(written);
                    return progress;
                }
                Err(TryRecvError::Disconnected) => (Vec::new(), Err(ENDED_EARLY.to_owned())),
            };
            (progress.buffer, progress.latest, progress.is_news) = (Some(buffer), Some(result), true);
        }
        progress
    }
}
