//! Image files, and the comparison of images.

use std::path::PathBuf;

use prpf::image::exr_file::{self, Channel, Precision, Windows};
use prpf::image::metrics::Pair;
use prpf::image::{self, Comparison, OutputFormat, png_file};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::{image_error, value_error};

/// Compares an image with its reference.
#[pyfunction]
pub fn compare<'py>(
    py: Python<'py>,
    image: &Bound<PyAny>,
    reference: &Bound<PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let (image, reference) = (arrays::rgb("image", image)?, arrays::rgb("reference", reference)?);
    let found = py.detach(|| Pair::new(&image, &reference).map(|pair| Comparison::new(&pair)));
    let found = found.map_err(value_error)?;
    let metrics = PyDict::new(py);
    for (name, value) in [
        ("mse", found.mse),
        ("relmse", found.relmse),
        ("block_relmse", found.block_relmse),
        ("psnr", found.psnr),
        ("ssim", found.ssim),
        ("flip", found.flip),
        ("mean_ratio", found.mean_ratio),
    ] {
        metrics.set_item(name, value)?;
    }
    metrics.set_item("excluded_pixels", found.excluded_pixels)?;
    Ok(metrics)
}

/// Reads an EXR, PNG, JPEG or TGA file in linear light.
#[pyfunction]
pub fn read_image(py: Python, path: PathBuf) -> PyResult<Py<PyAny>> {
    let planes = py.detach(|| image::read_rgb(&path)).map_err(image_error)?;
    arrays::image(py, planes)
}

/// Writes an image: `.exr` in linear light, `.png` tone-mapped.
#[pyfunction]
pub fn write_image(py: Python, path: PathBuf, image: &Bound<PyAny>) -> PyResult<()> {
    let format = OutputFormat::from_path(&path).map_err(image_error)?;
    let planes = arrays::rgb("image", image)?;
    let write = || match format {
        OutputFormat::Png => png_file::write(&path, &planes, 0.0),
        OutputFormat::Exr => {
            let channels: Vec<Channel> = ["R", "G", "B"]
                .into_iter()
                .enumerate()
                .map(|(plane, name)| Channel::new(name, planes.plane(plane), Precision::Float))
                .collect();
            exr_file::write(&path, Windows::whole(planes.width(), planes.height()), &channels, &[])
        }
    };
    py.detach(write).map_err(image_error)
}
