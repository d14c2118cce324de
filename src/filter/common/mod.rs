//! Steps that the denoisers share.

pub mod blur;
pub mod colours;
pub mod dual_buffer;
pub mod emitter_outlines;
pub mod error_maps;
pub mod exact_sum;
pub mod fast_exp;
pub mod fireflies;
pub mod firefly_redistribution;
pub mod half_counts;
pub mod hole_filling;
pub mod interleaved_planes;
pub mod lanes;
pub mod linear_estimate;
pub mod padded_planes;
pub mod variance_correction;
pub mod variance_pooling;

/// Fewest pixels of a task that takes a few operations for each: fewer are not worth another thread.
pub const TASK_PIXELS: usize = 1024;
