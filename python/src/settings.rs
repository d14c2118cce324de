//! The names of denoisers and samplings, as arguments.

use prpf::adaptive::Sampling;
use prpf::filter::{DENOISERS, Denoiser, find};
use pyo3::PyResult;

use crate::errors::value_error;

/// Returns the denoiser of a name such as `nlm` or `nlm draft`.
///
/// # Errors
/// An unknown name; a denoiser that this machine lacks.
pub fn denoiser(name: &str) -> PyResult<&'static dyn Denoiser> {
    let (method, preset) = match name.split_once(' ') {
        Some((method, preset)) => (method, Some(preset)),
        None => (name, None),
    };
    let Some(denoiser) = find(method, preset) else {
        let names: Vec<String> = DENOISERS.iter().map(|denoiser| denoiser.name().to_string()).collect();
        return Err(value_error(format!("denoiser: found `{name}`; accepted are {}", names.join(", "))));
    };
    match denoiser.missing() {
        Some(reason) => Err(value_error(format!("denoiser: found `{name}`; {reason}"))),
        None => Ok(denoiser),
    }
}

/// Returns how samples are placed, by its name.
///
/// # Errors
/// An unknown name.
pub fn sampling(name: &str) -> PyResult<Sampling> {
    match name {
        "adaptive" => Ok(Sampling::Adaptive),
        "uniform" => Ok(Sampling::Uniform),
        _ => Err(value_error(format!("sampling: found `{name}`; accepted are adaptive and uniform"))),
    }
}
