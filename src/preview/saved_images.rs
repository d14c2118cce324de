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

/// The saved images, oldest first.
#[derive(Default)]
pub struct SavedImages(Mutex<Vec<SavedFile>>);

impl SavedImages {
    fn files(&self) -> MutexGuard<'_, Vec<SavedFile>> {
        // A panic of another thread leaves the list intact.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an image, unless it is there.
    pub fn add(&self, file: SavedFile) {
        let mut files = self.files();
        if files.iter().all(|known| known.path != file.path) {
            files.push(file);
        }
    }

    /// Returns the path of an image by its number.
    pub fn path(&self, number: usize) -> Option<PathBuf> {
        self.files().get(number).map(|file| file.path.clone())
    }

    /// Returns the latest images, newest first.
    pub fn list(&self) -> Vec<ListedFile> {
        let entry = |(number, file): (usize, &SavedFile)| ListedFile {
            number,
            name: file.path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            spp: file.spp,
        };
        self.files().iter().enumerate().rev().take(MOST_LISTED).map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_listed_once_and_keeps_its_samples() {
        let saves = SavedImages::default();
        for spp in [Some(4.0), None] {
            saves.add(SavedFile { path: "a-0001.exr".into(), spp });
        }
        assert_eq!(saves.list().iter().map(|file| file.spp).collect::<Vec<_>>(), [Some(4.0)]);
    }
}
