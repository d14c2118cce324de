//! Surface interaction of one lane whose material has no SIMD version.

use crate::geometry::SurfaceInteraction;
use crate::render::bsdf::Bsdf;

/// A path at a surface that is shaded on its own.
pub struct ScalarInteraction<'s> {
    pub lane: usize,
    pub point: SurfaceInteraction,
    /// `None` before the material is evaluated, and for an interface.
    pub bsdf: Option<Bsdf<'s>>,
}

/// Returns the interactions in the lanes of `mask`.
pub fn scalar_lanes<'a, 's>(
    scalar: &'a [ScalarInteraction<'s>],
    mask: u32,
) -> impl Iterator<Item = &'a ScalarInteraction<'s>> {
    scalar.iter().filter(move |interaction| mask >> interaction.lane & 1 == 1)
}
