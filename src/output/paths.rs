//! Checks of the paths of outputs, before anything is rendered.

use std::path::{Path, PathBuf};

use crate::image::{self, OutputFormat};
use crate::{files, state};

/// In one line: the path, what is in its way, what is accepted.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct OutputPathError(String);

/// Checks, before minutes of rendering, that an output can be written.
///
/// # Errors
/// One line that names the path and what is in its way.
pub fn can_be_written(path: &Path) -> Result<(), OutputPathError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        let message = format!("{}: found no folder {}; it has to exist", path.display(), folder.display());
        return Err(OutputPathError(message));
    }
    if path.is_dir()
        || path.as_os_str().as_encoded_bytes().ends_with(std::path::MAIN_SEPARATOR_STR.as_bytes())
    {
        let message = format!("{}: found a folder; accepted is the name of a file", path.display());
        return Err(OutputPathError(message));
    }
    files::can_replace(path)
        .map_err(|error| OutputPathError(image::Problem::from(error).at(path).to_string()))
}

/// Checks that an output does not replace a render state.
///
/// # Errors
/// One line that names the path.
pub fn replaces_no_state(path: &Path) -> Result<(), OutputPathError> {
    if path.is_file() && state::check_signature(path).is_ok() {
        let message =
            format!("{}: found a render state; accepted is the name of another file", path.display());
        return Err(OutputPathError(message));
    }
    Ok(())
}

/// Returns whether a state exists where one will be written.
///
/// # Errors
/// The file exists and is no state.
pub fn replaces_state(path: &Path) -> Result<bool, OutputPathError> {
    let Ok(there) = std::fs::metadata(path) else { return Ok(false) };
    // An empty file may be a reserved name.
    if !there.is_file() || there.len() == 0 {
        return Ok(false);
    }
    state::check_signature(path).map(|()| true).map_err(|error| OutputPathError(error.to_string()))
}

/// Returns the canonical spelling of a file's name, whether there is such a file yet or not.
///
/// # Errors
/// Links in a circle, or a name that cannot be followed.
fn canonical(path: &Path) -> Result<PathBuf, OutputPathError> {
    let absolute = files::resolve_links(path).and_then(std::path::absolute);
    let absolute = absolute.map_err(|error| OutputPathError(format!("{}: {error}", path.display())))?;
    let of_new = || Some(absolute.parent()?.canonicalize().ok()?.join(absolute.file_name()?));
    Ok(absolute.canonicalize().ok().or_else(of_new).unwrap_or(absolute))
}

/// Checks that outputs replace neither each other nor a file that is read.
///
/// # Errors
/// One line that names the path.
pub fn are_distinct<'a>(
    inputs: impl IntoIterator<Item = &'a Path>,
    outputs: &[&Path],
) -> Result<(), OutputPathError> {
    let mut seen = inputs.into_iter().map(canonical).collect::<Result<Vec<_>, _>>()?;
    for path in outputs {
        let name = canonical(path)?;
        if seen.contains(&name) {
            let accepted = "accepted is another file for each output and input";
            return Err(OutputPathError(format!(
                "{}: found the same file twice; {accepted}",
                path.display()
            )));
        }
        seen.push(name);
    }
    Ok(())
}

/// Returns whether an output's name is that of an EXR image, which has layers.
pub fn is_exr(path: &Path) -> bool {
    matches!(OutputFormat::from_path(path), Ok(OutputFormat::Exr))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_that_cannot_be_written_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(can_be_written(&folder.path().join("new.exr")).is_ok());
        assert!(can_be_written(&folder.path().join("none/new.exr")).is_err());
        assert!(can_be_written(folder.path()).is_err());
        // A folder in which not even root may write.
        #[cfg(target_os = "linux")]
        assert!(can_be_written(Path::new("/proc/new.exr")).is_err());
    }

    #[test]
    fn outputs_replace_neither_each_other_nor_what_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("mesh.ply"), "").unwrap();
        let distinct = |read: &str, outputs: &[&str]| {
            let outputs: Vec<_> = outputs.iter().map(|name| at(name)).collect();
            are_distinct([&*at(read)], &outputs.iter().map(PathBuf::as_path).collect::<Vec<_>>()).is_ok()
        };
        assert!(distinct("mesh.ply", &["a.exr", "a.png"]));
        assert!(!distinct("mesh.ply", &["a.exr", "mesh.ply"]));
        assert!(!distinct("mesh.ply", &["a.exr", "./a.exr"]));
    }
}
