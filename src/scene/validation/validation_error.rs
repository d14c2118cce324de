//! The error type of [`crate::scene::Scene::validate`].

/// A value that makes a scene unsuitable for rendering.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValidationError {
    /// An index that is not less than the length of its list.
    #[error("{field} is {index}; expected an index below {count}")]
    IndexOutOfRange {
        /// Path of the field in the scene, such as `primitives[2].material`.
        field: String,
        index: usize,
        count: usize,
    },
    /// Any other value.
    #[error("{field} is {value}; expected {expected}")]
    InvalidValue {
        /// Path of the field in the scene, such as `camera.lens_radius`.
        field: String,
        value: String,
        expected: &'static str,
    },
}

impl ValidationError {
    /// Path of the field in the scene.
    pub fn field(&self) -> &str {
        match self {
            Self::IndexOutOfRange { field, .. } | Self::InvalidValue { field, .. } => field,
        }
    }
}

/// Result of a check.
pub type Result<T = ()> = std::result::Result<T, ValidationError>;
