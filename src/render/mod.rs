//! x
pub mod bsdf;
mod camera;
mod disk;
mod lights;
mod pixel_filter;
mod sampler;
