//! Renders batches of samples into a pixel-statistics store: samplers, camera rays, BSDFs, light sampling,
//! integrators.
//!
//! Takes a scene and the number of samples of each pixel; gives sample vectors in the order of the store's
//! [`Layout`](crate::stats::Layout). A sample is one path, whose sample values depend on seed, pixel, sample
//! index and dimension alone. Filters and budgets are unknown here.

pub mod bsdf;
mod camera_rays;
#[cfg(test)]
mod chi_squared;
mod disk;
mod filter_sampler;
mod integrator;
mod lights;
mod rejected_sample;
mod renderer;
mod row_renderer;
mod sample_layout;
mod sample_records;
mod sample_sink;
mod sampler;
mod shard;
mod sphere_map;

pub use integrator::{PathEvent, PathRadiance};
pub use rejected_sample::RejectedSample;
pub use renderer::Renderer;
pub use sample_layout::sample_layout;
pub use sample_sink::{RECORD_INDICES, SampleSink, record_bytes};
pub use shard::Shard;
