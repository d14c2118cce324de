//! Writes all samples of a render to one numpy archive, in the background.
//!
//! Takes the records of [`SampleSink`]; gives an uncompressed `.npz` archive of arrays `samples_000000`, `samples_000001`, …
//! of one record each sample, whose fields are `x`, `y`, `index` and the dimensions of the layout.

use std::io;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use super::npz::Npz;
use crate::files::replace_file;
use crate::render::{RECORD_INDICES, SampleSink, record_bytes};
use crate::stats::Layout;

/// Pieces that wait for the disk, beside the one that is being written.
const WAITING_PIECES: usize = 2;

/// A file of samples that is being written. It replaces an older one when it is finished, and no sooner.
pub struct SampleFile {
    /// Records; `None` ends the file.
    pieces: SyncSender<Option<Vec<u8>>>,
    writer: JoinHandle<io::Result<()>>,
}

impl SampleFile {
    /// Begins a file of samples of this layout.
    ///
    /// # Errors
    /// The system starts no thread.
    pub fn begin(path: &Path, layout: &Layout) -> io::Result<Self> {
        let (pieces, receiver) = sync_channel(WAITING_PIECES);
        let (path, layout) = (path.to_owned(), layout.clone());
        let work = move || replace_file(&path, |out| write(Npz::new(out), &layout, &receiver));
        let writer = thread::Builder::new().name("samples".into()).spawn(work)?;
        Ok(Self { pieces, writer })
    }

    /// Returns the bytes of a sample in a file.
    pub fn bytes_per_sample(layout: &Layout) -> usize {
        record_bytes(layout)
    }

    /// Waits until all samples are written, and ends the file.
    ///
    /// # Errors
    /// Those of the file system, whenever they occurred.
    pub fn finish(self) -> io::Result<()> {
        let _ = self.pieces.send(None);
        self.writer.join().unwrap_or_else(|_| Err(io::Error::other("the writer stopped")))
    }
}

impl SampleSink for SampleFile {
    /// Waits if the disk is slower than the render. After an error nothing more is written, and [`Self::finish`] returns it:
    /// there is still an image to come.
    fn take(&mut self, records: Vec<u8>) {
        let _ = self.pieces.send(Some(records));
    }
}

fn write<W: io::Write + io::Seek>(
    mut npz: Npz<W>,
    layout: &Layout,
    pieces: &Receiver<Option<Vec<u8>>>,
) -> io::Result<()> {
    let indices = RECORD_INDICES.map(|name| (name, "<u4"));
    let fields: Vec<(&str, &str)> =
        indices.into_iter().chain(layout.names().map(|name| (name, "<f4"))).collect();
    let next = || pieces.recv().map_err(|_| io::Error::other("the render was given up"));
    let mut number = 0;
    while let Some(records) = next()? {
        let count = records.len() / record_bytes(layout);
        npz.records(&format!("samples_{number:06}"), &fields, count, &records)?;
        number += 1;
    }
    npz.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_given_up_leaves_the_older_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("samples.npz");
        std::fs::write(&path, b"older").unwrap();
        let SampleFile { pieces, writer } =
            SampleFile::begin(&path, &Layout::with_blocks(|_| false)).unwrap();
        drop(pieces);
        assert!(writer.join().unwrap().is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"older");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
        SampleFile::begin(&path, &Layout::with_blocks(|_| false)).unwrap().finish().unwrap();
        assert_ne!(std::fs::read(&path).unwrap(), b"older");
    }
}
