//! Validates scenes that are built in memory.
//!
//! [`Scene::validate`] finds values with which rendering would panic or compute non-finite colours. The
//! [pbrt reader](super::pbrt) reports such values itself, at their location in the file.
//!
//! [`Scene::validate`]: super::Scene::validate

mod camera;
mod lights;
mod materials;
mod scene;
mod shapes;
mod textures;
mod validation_error;
mod values;

pub use self::validation_error::ValidationError;

#[cfg(test)]
mod tests;
