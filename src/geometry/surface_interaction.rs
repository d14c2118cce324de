//! Position, normals and parametrisation at a point on a surface.

use glam::{Vec2, Vec3};

use super::rounding;

/// The local geometry at a point on a surface, in render space (pbrt-v4's `SurfaceInteraction`).
#[derive(Clone, Copy, Debug)]
pub struct SurfaceInteraction {
    pub position: Vec3,
    /// Bound on the absolute error of `position`, per axis (pbrt-v4, section 6.8).
    pub position_error: Vec3,
    /// Unit geometric normal, on the side that an area light emits from; not turned to the viewer.
    pub geometric_normal: Vec3,
    /// Unit interpolated normal, in the hemisphere of `geometric_normal`.
    pub shading_normal: Vec3,
    /// ∂p/∂u; never zero, nor parallel to `dpdv`. Not normalised, and not orthogonal to either
    /// normal or to `dpdv`. On meshes with normals, the tangents are those of
    /// [`MeshTangents`](crate::scene::MeshTangents).
    pub dpdu: Vec3,
    /// ∂p/∂v.
    pub dpdv: Vec3,
    pub uv: Vec2,
    /// Index into [`Scene::primitives`](crate::scene::Scene::primitives).
    pub primitive: u32,
    /// Triangle of a mesh; 0 for other shapes.
    pub element: u32,
}

impl SurfaceInteraction {
    /// Origin for a ray that leaves in direction `w`, moved off the surface by the error bound.
    pub fn offset_origin(&self, w: Vec3) -> Vec3 {
        rounding::offset_origin(self.position, self.position_error, self.geometric_normal, w)
    }
}
