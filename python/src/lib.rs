//! The Python package `prpf`: scenes, pixel statistics, denoisers, allocation and the render loop, as numpy arrays.
//!
//! Each module wraps one part of the library's public face, checks its arguments and converts arrays and errors; nothing
//! is computed here. `__init__.pyi` documents the classes and functions.

mod allocation;
mod arguments;
mod arrays;
mod denoising;
mod errors;
mod images;
mod limits;
mod merging;
mod paths;
mod placement;
mod render;
mod render_files;
mod render_host;
mod render_job;
mod scene;
mod store;

/// A progressive path tracer whose adaptive sampling is coupled to its denoiser: its scenes, pixel statistics,
/// denoisers, allocation and render loop.
#[pyo3::pymodule(name = "_prpf")]
mod module {
    #[pymodule_export]
    use crate::allocation::{allocate, priority};
    #[pymodule_export]
    use crate::denoising::{Denoised, Estimate, denoise, denoisers, use_weights};
    #[pymodule_export]
    use crate::errors::Error;
    #[pymodule_export]
    use crate::images::{compare, read_image, write_image};
    #[pymodule_export]
    use crate::merging::merge;
    #[pymodule_export]
    use crate::render::{Render, render};
    #[pymodule_export]
    use crate::render_host::Pass;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::store::Store;
}
