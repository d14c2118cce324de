//! Finds the scene files in a folder and those below it.

use std::io::Read;
use std::path::{Path, PathBuf};

/// Most folders within each other, most entries that are looked at, and most scenes that are found.
const DEEPEST: usize = 4;
const MOST_ENTRIES: usize = 5000;
const MOST_SCENES: usize = 200;
/// Bytes of a file within which a scene has its `WorldBegin`; files that scenes include have none.
const HEADER_BYTES: u64 = 1 << 16;

/// Returns the scene files in the folder of a scene and below, sorted; that scene's own spelling is kept.
pub(super) fn scenes_beside(scene: &Path) -> Vec<PathBuf> {
    let folder = scene.parent().unwrap_or(Path::new(""));
    let mut found = vec![scene.to_owned()];
    let mut entries = 0;
    let mut folders = vec![(folder.to_owned(), 1)];
    while let Some((folder, depth)) = folders.pop() {
        let shown = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
        let Ok(content) = std::fs::read_dir(shown) else { continue };
        for entry in content.flatten() {
            entries += 1;
            if entries > MOST_ENTRIES || found.len() == MOST_SCENES {
                break;
            }
            let path = folder.join(entry.file_name());
            // Links are not followed: they may lead out of the folder, or in circles.
            let Ok(kind) = entry.file_type() else { continue };
            if kind.is_dir() && depth < DEEPEST {
                folders.push((path, depth + 1));
            } else if kind.is_file() && path != scene && is_scene(&path) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

fn is_scene(path: &Path) -> bool {
    if path.extension().is_none_or(|extension| extension != "pbrt") {
        return false;
    }
    let mut header = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(HEADER_BYTES).read_to_end(&mut header));
    let word = b"WorldBegin";
    read.is_ok() && header.windows(word.len()).any(|window| window == word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_found_without_the_files_that_they_include() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("below")).unwrap();
        for (name, text) in [
            ("b.pbrt", "WorldBegin"),
            ("a.pbrt", "Camera \"perspective\" WorldBegin"),
            ("geometry.pbrt", "Shape \"sphere\""),
            ("notes.txt", "WorldBegin"),
            ("below/c.pbrt", "WorldBegin"),
        ] {
            std::fs::write(at(name), text).unwrap();
        }
        assert_eq!(scenes_beside(&at("b.pbrt")), [at("a.pbrt"), at("b.pbrt"), at("below/c.pbrt")]);
    }
}
