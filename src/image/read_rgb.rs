//! Reads an image file of any supported format.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::{ImageError, Planes, Problem, exr_file, png_file};

/// Reads the red, green and blue planes of an EXR, PNG, JPEG or TGA file, in linear light.
///
/// The content decides the format, not the file name. Values of 8- and 16-bit files are decoded from
/// sRGB.
///
/// # Errors
/// [`Problem::Io`], and the errors of [`exr_file::read_layer`] and [`png_file::read`].
pub fn read_rgb(path: &Path) -> Result<Planes, ImageError> {
    let mut file = open_file(path).map_err(|problem| problem.at(path))?;
    let mut start = [0; exr_file::MAGIC.len()];
    let is_exr = file.read_exact(&mut start).is_ok_and(|()| start == exr_file::MAGIC);
    if is_exr { exr_file::read_layer(path, None) } else { png_file::read(path) }
}

/// Opens an image file.
///
/// # Errors
/// Those of the file system; a pipe or a device.
pub(super) fn open_file(path: &Path) -> Result<File, Problem> {
    // Opening a pipe would wait for a writer.
    let metadata = path.metadata()?;
    if !metadata.is_file() && !metadata.is_dir() {
        return Err(Problem::Malformed("it is not a regular file".to_owned()));
    }
    Ok(File::open(path)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_content_decides_what_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let mut planes = Planes::new(2, 1, 3);
        planes.data_mut().copy_from_slice(&[0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        let png = folder.path().join("a.png");
        png_file::write(&png, &planes, 0.0).unwrap();
        let misnamed = folder.path().join("a.exr");
        std::fs::rename(&png, &misnamed).unwrap();
        assert_eq!(read_rgb(&misnamed).unwrap(), planes);
    }

    #[test]
    fn a_missing_an_empty_and_a_text_file_are_errors_that_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        assert!(read_rgb(&path).unwrap_err().to_string().ends_with("a.exr: no such file or folder"));
        for content in ["", "This is not an image at all."] {
            std::fs::write(&path, content).unwrap();
            let error = read_rgb(&path).unwrap_err().to_string();
            assert!(error.contains("a.exr: ") && error.contains("not an EXR, PNG, JPEG or TGA"), "{error}");
        }
        assert!(read_rgb(folder.path()).is_err());
    }
}
