//! The images that were saved, also by earlier runs, for the page to compare with.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::Serialize;

/// Most images that the page lists: every status repeats them.
const MOST_LISTED: usize = 50;

/// A saved image.
#[derive(Clone, Debug)]
pub struct SavedFile {
    pub path: PathBuf,
    /// Samples per pixel; `None` for an image of an earlier run.
    pub spp: Option<f64>,
}

/// The entry of an image in the page's list.
#[derive(Clone, Debug, Serialize)]
pub struct ListedFile {
    /// Number by which the server gives the image.
    pub number: usize,
    pub name: String,
    pub spp: Option<f64>,
}

/// The saved images.
#[derive(Default)]
pub struct SavedImages(Mutex<NumberedFiles>);

#[derive(Default)]
struct NumberedFiles {
    /// Oldest first.
    files: Vec<(usize, SavedFile)>,
    /// Number of the next one.
    next: usize,
}

impl SavedImages {
    fn files(&self) -> MutexGuard<'_, NumberedFiles> {
        // A panic of another thread leaves the list intact.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an image that a viewer has saved. One that had its path before, and was removed, leaves the list.
    pub fn add(&self, file: SavedFile) {
        let NumberedFiles { files, next } = &mut *self.files();
        files.retain(|(_, known)| known.path != file.path);
        files.push((*next, file));
        // A page has kept the earlier image under its number.
        *next += 1;
    }

    /// Adds an image of an earlier run, unless it is there.
    pub fn add_earlier(&self, path: PathBuf) {
        if self.files().files.iter().all(|(_, known)| known.path != path) {
            self.add(SavedFile { path, spp: None });
        }
    }

    /// Returns the path of an image by its number.
    pub fn path(&self, number: usize) -> Option<PathBuf> {
        let NumberedFiles { files, .. } = &*self.files();
        files.iter().find(|(known, _)| *known == number).map(|(_, file)| file.path.clone())
    }

    /// Returns the latest images, newest first.
    pub fn list(&self) -> Vec<ListedFile> {
        let entry = |(number, file): &(usize, SavedFile)| ListedFile {
            number: *number,
            name: file.path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            spp: file.spp,
        };
        self.files().files.iter().rev().take(MOST_LISTED).map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_listed_once_and_keeps_its_samples() {
        let saves = SavedImages::default();
        saves.add(SavedFile { path: "a-0001.exr".into(), spp: Some(4.0) });
        saves.add_earlier("a-0001.exr".into());
        let listed = || saves.list().iter().map(|file| (file.number, file.spp)).collect::<Vec<_>>();
        assert_eq!(listed(), [(0, Some(4.0))]);
        // After the file was removed, another image has its name.
        saves.add(SavedFile { path: "a-0001.exr".into(), spp: Some(8.0) });
        assert_eq!(listed(), [(1, Some(8.0))]);
        assert_eq!((saves.path(0), saves.path(1)), (None, Some("a-0001.exr".into())));
    }
}
