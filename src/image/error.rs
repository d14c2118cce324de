//! Errors of reading and writing image files: the file and its problem.

use std::io;
use std::path::{Path, PathBuf};

use crate::files::error_message;

/// Largest width or height of an image that is read.
pub const MAX_SIDE: usize = 1 << 16;

/// Largest number of values (pixels × channels) of an image that is read: 4 GiB as `f32`.
///
/// A header of a few hundred bytes can claim terabytes, so sizes are checked before allocation.
pub const MAX_SAMPLES: usize = 1 << 30;

/// An image file and its problem. The message is complete; the error has no source.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct ImageError {
    pub path: PathBuf,
    pub problem: Problem,
}

/// A problem of an image file.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    #[error("{}", error_message(.0))]
    Io(#[from] io::Error),
    #[error("the image is unreadable or damaged: {0}")]
    Malformed(String),
    #[error("the image is not supported: {0}")]
    Unsupported(String),
    #[error(
        "the header claims {width}x{height} pixels of {channels} channels; the largest readable image has \
         {MAX_SIDE} pixels a side and {MAX_SAMPLES} values"
    )]
    TooLarge { width: usize, height: usize, channels: usize },
    #[error("channels {} are missing; the file has {}", wanted.join(", "), present.join(", "))]
    MissingChannels { wanted: Vec<String>, present: Vec<String> },
    #[error("the image does not fit: {0}")]
    Memory(String),
    #[error("the image has no pixels")]
    Empty,
    #[error("unknown extension; use .exr or .png")]
    UnknownExtension,
    #[error("cannot be written: {0}")]
    Unwritable(String),
}

impl Problem {
    /// The error of this problem in the file `path`.
    pub fn at(self, path: &Path) -> ImageError {
        ImageError { path: path.to_path_buf(), problem: self }
    }
}

impl From<exr::error::Error> for Problem {
    fn from(error: exr::error::Error) -> Self {
        use exr::error::Error;
        match error {
            Error::Io(error) => Self::Io(error),
            Error::NotSupported(what) => Self::Unsupported(what.into_owned()),
            Error::Invalid(what) => Self::Malformed(what.into_owned()),
            Error::Aborted => Self::Malformed("reading was cancelled".into()),
        }
    }
}

impl From<image::ImageError> for Problem {
    fn from(error: image::ImageError) -> Self {
        match error {
            image::ImageError::IoError(error) if error.kind() != io::ErrorKind::UnexpectedEof => {
                Self::Io(error)
            }
            image::ImageError::Unsupported(error) => Self::Unsupported(error.to_string()),
            error => Self::Malformed(error.to_string()),
        }
    }
}
