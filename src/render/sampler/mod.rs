//! Samplers: random numbers in [0, 1), the sample values, by dimension. A sample value depends on (seed, pixel,
//! sample index, dimension) alone, so that an image depends neither on threads nor on batches.
//!
//! [`Dimensions`] allots the dimensions to purposes and generates the values of camera rays
//! (`CameraSamples`) and scattering events ([`BounceSamples`]), one path a lane.

mod bounce_samples;
mod camera_samples;
mod dimensions;
mod independent;
mod sample_address;
#[expect(clippy::module_inception, reason = "the trait's file")]
mod sampler;
mod sobol;
#[cfg(test)]
mod tests;
mod value_block;

pub use bounce_samples::BounceSamples;
pub use dimensions::{Dimensions, RequiredDimensions};
pub use independent::Independent;
pub use sample_address::{SampleAddress, SampleAddresses};
pub use sampler::Sampler;
pub use sobol::Sobol;
