//! Scene-wide rendering options: the directives before `WorldBegin`.

use glam::DVec3;

use super::TransformSet;
use crate::scene::pbrt::parser::Statement;
use crate::scene::{Camera, Film, Integrator, SamplerKind};

/// An option directive, kept until `WorldBegin`, with the current transform at its place.
pub struct OptionStatement {
    pub statement: Statement,
    pub ctm: TransformSet,
}

/// Scene-wide rendering options.
pub struct RenderOptions {
    /// World position of the camera at shutter open.
    pub origin: DVec3,
    pub camera: Camera,
    pub film: Film,
    pub integrator: Integrator,
    pub sampler: SamplerKind,
    /// Samples per pixel.
    pub spp: u32,
}
