//! Turns the library's errors into Python exceptions with the same words.
//!
//! Arguments out of range are `ValueError`, the file system's errors `OSError` or one of its subclasses, too little memory
//! is `MemoryError`, and a file with wrong content is [`Error`].

use std::fs::File;
use std::io;
use std::path::Path;

use prpf::RenderError;
use prpf::image::{ImageError, Problem};
use prpf::scene::pbrt::SceneError;
use prpf::state::{CheckpointError, StateError, StateErrorKind};
use pyo3::exceptions::{
    PyException, PyFileNotFoundError, PyMemoryError, PyOSError, PyPermissionError, PyValueError,
};
use pyo3::{PyErr, Python, create_exception};

create_exception!(prpf, Error, PyException, "A scene, an image or a state whose content is wrong.");

/// A `ValueError` that says what was found and what is accepted.
pub fn value_error(message: impl ToString) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// An exception of the file system.
pub fn file_error(kind: io::ErrorKind, message: String) -> PyErr {
    match kind {
        io::ErrorKind::NotFound => PyFileNotFoundError::new_err(message),
        io::ErrorKind::PermissionDenied => PyPermissionError::new_err(message),
        _ => PyOSError::new_err(message),
    }
}

pub fn image_error(error: ImageError) -> PyErr {
    match &error.problem {
        Problem::Io(cause) => file_error(cause.kind(), error.to_string()),
        Problem::UnknownExtension => value_error(error),
        Problem::Memory(_) => PyMemoryError::new_err(error.to_string()),
        Problem::Unwritable(_) => PyOSError::new_err(error.to_string()),
        _ => Error::new_err(error.to_string()),
    }
}

pub fn state_error(error: StateError) -> PyErr {
    match &error.kind {
        StateErrorKind::File(cause) => file_error(cause.kind(), error.to_string()),
        StateErrorKind::Memory(_) => PyMemoryError::new_err(error.to_string()),
        _ => Error::new_err(error.to_string()),
    }
}

pub fn checkpoint_error(error: &CheckpointError) -> PyErr {
    file_error(error.cause.kind(), error.to_string())
}

/// The exception of a scene that cannot be read; `file` is why its main file cannot be opened.
pub fn scene_error(error: SceneError, file: Option<io::ErrorKind>) -> PyErr {
    match file {
        Some(kind) => file_error(kind, error.to_string()),
        None => Error::new_err(error.to_string()),
    }
}

/// Returns why a file cannot be opened for reading; `None` if it can. Nothing is read, because a device may never end.
pub fn open_failure(path: &Path) -> Option<io::ErrorKind> {
    match path.metadata() {
        Err(error) => Some(error.kind()),
        // Opening a pipe would wait for a writer
        Ok(found) if !found.is_file() => Some(io::ErrorKind::InvalidInput),
        Ok(_) => File::open(path).err().map(|error| error.kind()),
    }
}

pub fn render_error(error: RenderError) -> PyErr {
    match &error {
        RenderError::Scene(_) => Error::new_err(error.to_string()),
        RenderError::Memory(_) => PyMemoryError::new_err(error.to_string()),
        RenderError::Settings(_) | RenderError::Differs { .. } => value_error(error),
    }
}

/// Returns the first error, with the second as its cause, the third as the cause of that, and so on; `None` if there is none.
pub fn chain(py: Python, errors: Vec<PyErr>) -> Option<PyErr> {
    let mut errors = errors.into_iter();
    let first = errors.next()?;
    if errors.len() > 0 {
        // What a callback has raised may have a cause of its own: it comes last
        let causes = errors.rfold(first.cause(py), |cause, error| {
            error.set_cause(py, cause);
            Some(error)
        });
        first.set_cause(py, causes);
    }
    Some(first)
}
