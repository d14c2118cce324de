//! The file formats of written images.

use std::path::Path;

use super::{ImageError, Problem};

/// A file format of written images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputFormat {
    /// All layers, linear, 32- or 16-bit float.
    Exr,
    /// The image alone, 8-bit sRGB.
    Png,
}

impl OutputFormat {
    /// The format of a file name's extension, in upper or lower case.
    ///
    /// # Errors
    /// [`Problem::UnknownExtension`]. Callers check this before a render, not after it.
    pub fn from_path(path: &Path) -> Result<Self, ImageError> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "exr" => Ok(Self::Exr),
            "png" => Ok(Self::Png),
            _ => Err(Problem::UnknownExtension.at(path)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extension_decides_what_is_written() {
        assert_eq!(OutputFormat::from_path(Path::new("a/b.exr")).unwrap(), OutputFormat::Exr);
        assert_eq!(OutputFormat::from_path(Path::new("b.PNG")).unwrap(), OutputFormat::Png);
        for name in ["b", "b.jpg", ".exr", "exr", "b.exr.gz"] {
            let message = OutputFormat::from_path(Path::new(name)).unwrap_err().to_string();
            assert_eq!(message, format!("{name}: unknown extension; use .exr or .png"));
        }
    }
}
