//! Entry points of the reader.

use std::path::Path;

use super::builder::{CameraFile, SceneBuilder};
use super::parser;
use super::{ReadProgress, SceneError, files};
use crate::scene::Scene;

/// Reads a scene file and the files it includes. File names in them are relative to the main file's
/// folder.
///
/// # Errors
/// If a file is missing or has an error.
pub fn read(path: &Path) -> Result<Scene, SceneError> {
    read_reporting(path, None, |_| {})
}

/// Like [`read`], and calls `report` after each shape. The camera is that of the file `camera` if there is one:
/// directives such as `LookAt` and `Camera`, without a world.
///
/// # Errors
/// As [`read`], of either file.
pub fn read_reporting(
    path: &Path,
    camera: Option<&Path>,
    report: impl Fn(ReadProgress) + 'static,
) -> Result<Scene, SceneError> {
    let source = path.display().to_string();
    let read = |path: &Path, kind: &str| {
        files::read(path).map_err(|message| SceneError {
            file: path.display().to_string(),
            line: 0,
            column: 0,
            message: format!("cannot be read: {message}; expected {kind}"),
        })
    };
    let text = read(path, "a pbrt scene file")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut builder = SceneBuilder::new(&text, source.clone(), folder, Some(path));
    builder.report_progress = Box::new(report);
    if let Some(camera) = camera {
        let text = read(camera, "a file with the directives LookAt and Camera")?;
        builder.camera_file = Some(CameraFile { path: camera.to_owned(), text });
    }
    let mut scene = build(builder, &text)?;
    scene.source = source;
    Ok(scene)
}

/// Reads a scene from text; file names in it are relative to `folder`.
///
/// # Errors
/// As [`read`].
pub fn read_str(text: &str, folder: &Path) -> Result<Scene, SceneError> {
    let builder = SceneBuilder::new(text.as_bytes(), "<text>".into(), folder, None);
    build(builder, text.as_bytes())
}

/// Carries out the directives of the main file, then what needs the whole scene.
fn build(mut builder: SceneBuilder, text: &[u8]) -> Result<Scene, SceneError> {
    let mut run = || -> parser::Result<()> {
        builder.add_default_material();
        builder.read_text(text, 0)?;
        builder.check_end()?;
        builder.check_forward_materials()?;
        builder.check_forward_mixes()?;
        builder.place_forward_instances()?;
        builder.load_images()?;
        builder.scale_lights_to_power()?;
        builder.remove_interfaces();
        Ok(())
    };
    match run() {
        Ok(()) => Ok(builder.into_scene()),
        Err(error) => Err(SceneError::from_parse_error(error, &builder.files)),
    }
}
