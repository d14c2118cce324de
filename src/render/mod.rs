//! x
pub mod bsdf;
mod sampler;
