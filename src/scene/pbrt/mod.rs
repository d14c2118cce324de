//! Reader of pbrt's scene description.
//!
//! `lexer`: text → tokens. `directives`: tokens → statements, by the table of directives, each
//! of which is a method of `state::Reader`; these methods are spread over the files by what they
//! make. What differs between the dialects v2, v3 and v4 stands in `dialect`, how they are told apart in `detection`.
//!
//! Source: the file format specification of pbrt-v4 (pbrt.org/fileformat-v4).

mod bilinear;
mod camera_film;
mod color_space;
mod curve;
mod detection;
mod dialect;
mod directives;
mod files;
mod image_files;
mod lexer;
mod lights;
mod loop_subdivision;
mod materials;
mod measured;
mod mesh;
mod objects;
mod params;
mod ply;
mod projectors;
mod revolution;
mod shapes;
mod spectrum;
mod state;
#[cfg(test)]
mod tests;
mod textures;
mod transforms;
mod warnings;

use std::path::Path;

pub use self::dialect::Dialect;
use self::state::Reader;
use super::Scene;

/// Why a scene could not be read: file, line, column, what was found, what would be accepted.
#[derive(Debug, thiserror::Error)]
#[error("{}: {message}", position(file, *line, *column))]
pub struct SceneError {
    pub file: String,
    /// 1-based; 0 where the error concerns the file as a whole, of which no place is printed then.
    pub line: usize,
    pub column: usize,
    pub message: String,
}

/// `file:line:column`, or the file alone where it is meant as a whole.
fn position(file: &str, line: usize, column: usize) -> String {
    if line == 0 { file.to_owned() } else { format!("{file}:{line}:{column}") }
}

/// Where a token stands: the number of the file in [`state::Reader::files`], and 1-based line and
/// column (in bytes); all 0 for the main file as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Place {
    file: u32,
    line: u32,
    column: u32,
}

/// An error before its file has a name.
#[derive(Debug)]
struct Fault {
    place: Place,
    message: String,
}

impl Fault {
    fn new(place: Place, message: impl Into<String>) -> Self {
        Self { place, message: message.into() }
    }
}

type Result<T> = std::result::Result<T, Fault>;

/// How far reading has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// Shapes that were read, and triangles of these.
    pub shapes: usize,
    pub triangles: usize,
}

/// Reads a scene file and all it includes. File names in it are relative to its folder.
///
/// # Errors
/// On anything that is wrong in a file, or missing.
pub fn read(path: &Path) -> std::result::Result<Scene, SceneError> {
    read_reporting(path, |_| {})
}

/// As [`read`]; `report` is told after every shape how far it has come.
///
/// # Errors
/// As [`read`].
pub fn read_reporting(
    path: &Path,
    report: impl Fn(Reading) + 'static,
) -> std::result::Result<Scene, SceneError> {
    let source = path.display().to_string();
    let text = files::read(path).map_err(|message| SceneError {
        file: source.clone(),
        line: 0,
        column: 0,
        message: format!("cannot be read: {message}; a pbrt scene file would be accepted"),
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut reader = Reader::new(&text, source.clone(), folder, Some(path));
    reader.report = Box::new(report);
    let mut scene = reader.read(&text)?;
    scene.source = source;
    Ok(scene)
}

/// Reads a scene from text; relative file names are resolved against `folder`.
///
/// # Errors
/// As [`read`].
pub fn read_str(text: &str, folder: &Path) -> std::result::Result<Scene, SceneError> {
    Reader::new(text.as_bytes(), "<text>".into(), folder, None).read(text.as_bytes())
}
