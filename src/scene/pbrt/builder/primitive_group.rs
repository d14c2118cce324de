//! Groups of primitives that share a coordinate system.

use glam::DVec3;

use crate::scene::Primitive;

/// Primitives that share a coordinate system.
#[derive(Default)]
pub struct PrimitiveGroup {
    /// Name of the object that the group belongs to; empty outside objects.
    pub name: String,
    pub primitives: Vec<Primitive>,
    /// Position of the group's origin in object (or world) space, set by the first shape.
    ///
    /// Coordinates relative to it keep their precision as `f32` far from the space's origin.
    pub pivot: Option<DVec3>,
}

impl PrimitiveGroup {
    pub fn new(name: String) -> Self {
        Self { name, ..Self::default() }
    }
}
