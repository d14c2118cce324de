//! Writes checkpoints of a render to one file while the render goes on.
//!
//! Encoding a state copies it, which takes a moment; a thread of its own then writes the copy, which takes as long as
//! the disk takes. One buffer is used for all of them.

use std::io;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

use super::encode::encode;
use super::render_state::RenderState;
use crate::files::ExclusiveFile;

const ENDED_EARLY: &str = "the thread that writes states ended early";

/// Writes render states to one file, one after the other, on a thread of its own. Dropping it waits for the latest one and
/// unlocks the file.
pub(super) struct CheckpointWriter {
    /// `None` once it is dropped.
    to_write: Option<Sender<Vec<u8>>>,
    /// Buffers that come back once they are written, and the result of writing each.
    written: Mutex<Receiver<(Vec<u8>, io::Result<()>)>>,
    progress: Mutex<WriteProgress>,
    /// `None` once it is dropped.
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct WriteProgress {
    /// The one buffer; `None` while it is being written.
    buffer: Option<Vec<u8>>,
    /// Result of the latest write that has ended.
    latest: Option<Result<(), Arc<io::Error>>>,
    /// Whether [`CheckpointWriter::new_result`] has not returned it yet.
    is_new: bool,
}

impl CheckpointWriter {
    /// Locks the file and starts the thread. `bytes` is the expected size of a state.
    ///
    /// # Errors
    /// A file that cannot be written or that another process owns, or a disk without space for `bytes`.
    pub fn new(path: &Path, bytes: usize) -> io::Result<Self> {
        let mut target = ExclusiveFile::new(path)?;
        target.check_space(bytes)?;
        let (to_write, jobs) = channel::<Vec<u8>>();
        let (done, written) = channel();
        let thread = std::thread::Builder::new().name("state".into()).spawn(move || {
            for file in jobs {
                let result = target.replace(&file);
                if done.send((file, result)).is_err() {
                    return;
                }
            }
        })?;
        let progress = Mutex::new(WriteProgress { buffer: Some(Vec::new()), ..WriteProgress::default() });
        Ok(Self { to_write: Some(to_write), written: Mutex::new(written), progress, thread: Some(thread) })
    }

    /// Starts to write a state; waits first until the one before is written.
    pub fn write(&self, state: &RenderState) {
        let mut progress = self.progress(true);
        let mut file = progress.buffer.take().unwrap_or_default();
        encode(state, &mut file);
        // Fails only if the thread is gone, which `wait` reports.
        let _ = self.to_write.as_ref().map(|to_write| to_write.send(file));
    }

    /// Returns the result of the latest write that has ended, once; `None` if there is no new one.
    pub fn new_result(&self) -> Option<Result<(), Arc<io::Error>>> {
        let mut progress = self.progress(false);
        std::mem::take(&mut progress.is_new).then(|| progress.latest.clone()).flatten()
    }

    /// Returns whether a state is being written: [`Self::write`] would wait for it.
    pub fn is_writing(&self) -> bool {
        self.progress(false).buffer.is_none()
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// That of the file system for the last state.
    pub fn wait(&self) -> Result<(), Arc<io::Error>> {
        self.progress(true).latest.clone().unwrap_or(Ok(()))
    }

    /// Takes back a buffer that has been written; if `waits`, until nothing is being written.
    fn progress(&self, waits: bool) -> MutexGuard<'_, WriteProgress> {
        let mut progress = self.progress.lock().expect("no thread panics while it holds this");
        if progress.buffer.is_none() {
            let written = self.written.lock().expect("no thread panics while it holds this");
            let ended = if waits {
                written.recv().map_err(|_| TryRecvError::Disconnected)
            } else {
                written.try_recv()
            };
            let (buffer, result) = match ended {
                Ok((buffer, result)) => (buffer, result.map_err(Arc::new)),
                Err(TryRecvError::Empty) => {
                    drop(written);
                    return progress;
                }
                Err(TryRecvError::Disconnected) => (Vec::new(), Err(Arc::new(io::Error::other(ENDED_EARLY)))),
            };
            (progress.buffer, progress.latest, progress.is_new) = (Some(buffer), Some(result), true);
        }
        progress
    }
}

impl Drop for CheckpointWriter {
    fn drop(&mut self) {
        drop(self.to_write.take());
        // A panic of the thread is what `wait` reports.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
