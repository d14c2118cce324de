//! Gets states to the disk while the render goes on: what is known is copied, which takes a moment, and
//! a thread of its own writes it, which takes as long as the disk takes.

use std::io;
use std::path::Path;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use super::{State, bytes};
use crate::image::atomic::OwnFile;

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
    /// How the latest writing ended.
    latest: Option<io::Result<()>>,
}

impl Keeper {
    /// Will keep states in this file.
    ///
    /// # Errors
    /// A file that cannot be written or that another program keeps, or a disk without room for so many bytes: known
    /// before any work.
    pub fn new(path: &Path, size: usize) -> io::Result<Self> {
        let mut own = OwnFile::new(path)?;
        own.has_room(size)?;
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
        let state = Mutex::new(Progress { buffer: Some(Vec::new()), latest: None });
        Ok(Self { to_write, written: Mutex::new(written), state, thread })
    }

    /// Has a state written, after the one that is being written. An error is of that earlier one.
    pub fn keep(&self, state: &State) -> io::Result<()> {
        let mut progress = self.state.lock().expect("no thread panics while it holds this");
        let earlier = self.wait(&mut progress);
        let mut file = progress.buffer.take().unwrap_or_default();
        bytes(state, &mut file);
        // Fails only if the thread is gone, which `finish` reports.
        let _ = self.to_write.send(file);
        earlier
    }

    /// Waits until all is written.
    ///
    /// # Errors
    /// What the file system said to the last state.
    pub fn finish(self) -> io::Result<()> {
        let result = self.wait(&mut self.state.lock().expect("no thread panics while it holds this"));
        drop(self.to_write);
        self.thread.join().map_err(|_| io::Error::other("the thread that writes states ended early"))?;
        result
    }

    fn wait(&self, progress: &mut Progress) -> io::Result<()> {
        if progress.buffer.is_none() {
            let written = self.written.lock().expect("no thread panics while it holds this");
            let (buffer, result) =
                written.recv().map_err(|_| io::Error::other("the thread that writes states ended early"))?;
            progress.buffer = Some(buffer);
            progress.latest = Some(result);
        }
        progress.latest.take().unwrap_or(Ok(()))
    }
}
