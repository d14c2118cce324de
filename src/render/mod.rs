//! Not yet.

pub mod bsdf;
