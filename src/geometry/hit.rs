//! The nearest intersection of a ray, by its distance and indices into the scene.

use glam::Vec2;

/// The nearest intersection of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance, in units of the ray direction's length.
    pub t: f32,
    /// Index into [`Scene::primitives`](crate::scene::Scene::primitives).
    pub primitive: u32,
    /// Triangle of a mesh; for spheres and disks an index internal to this room.
    pub element: u32,
    /// Index into [`Scene::instances`](crate::scene::Scene::instances), or [`Hit::STATIC`].
    pub instance: u32,
    /// Barycentric coordinates of vertices 1 and 2; 0 for spheres and disks.
    pub barycentric: Vec2,
}

impl Hit {
    /// `instance` of hits on the static object.
    pub const STATIC: u32 = u32::MAX;
}
