//! What can be wrong with an image file, in one type: the file, and the problem in words a person
//! can act on.

use std::io;
use std::path::{Path, PathBuf};

use crate::files::error_message;

/// Largest width or height that is read from a file.
pub const MAX_SIDE: usize = 1 << 16;

/// Largest number of values (pixels × channels) that is read from a file: 4 GiB as `f32`.
///
/// A header of a few hundred bytes can claim terabytes, so sizes are checked against this before
/// anything is allocated.
pub const MAX_SAMPLES: usize = 1 << 30;

/// A file and what is wrong with it. The message is whole: there is no deeper source to print.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct ImageError {
    pub path: PathBuf,
    pub problem: Problem,
}

#[derive(Debug, thiserror::Error)]
pub enum Problem {
    #[error("{}", error_message(.0))]
    Io(#[from] io::Error),
    #[error("not a readable image, or damaged: {0}")]
    Malformed(String),
    #[error("not supported: {0}")]
    Unsupported(String),
    #[error(
        "the header asks for {width}x{height} pixels of {channels} channels; up to {MAX_SIDE} pixels a \
         side and {MAX_SAMPLES} values in all are read"
    )]
    TooLarge { width: usize, height: usize, channels: usize },
    #[error("no channels {}; the file has {}", wanted.join(", "), present.join(", "))]
    MissingChannels { wanted: Vec<String>, present: Vec<String> },
    #[error("the image has no pixels")]
    Empty,
    #[error("unknown extension, .exr or .png expected")]
    UnknownExtension,
    #[error("cannot be written: {0}")]
    Unwritable(String),
}

impl Problem {
    /// The problem, with the file it was found in.
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
