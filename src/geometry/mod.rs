//! Acceleration structure and intersection: instances, motion, robust offsets.
//!
//! Knows nothing of shading; the one thing it asks of the scene beyond shapes is the alpha
//! texture of cut-out surfaces.

use glam::{Vec2, Vec3};

use crate::scene::Scene;

mod sampling;
pub use sampling::{ShapeSample, area, pdf_shape, sample_shape};

/// A ray in render space.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: Vec3,
    /// Need not be normalised; distances are in units of its length.
    pub direction: Vec3,
    /// Hits at this distance or farther do not count.
    pub t_max: f32,
    /// Scene time, for moving instances.
    pub time: f32,
}

/// The nearest intersection of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    pub t: f32,
    /// Index into [`Scene::primitives`].
    pub primitive: u32,
    /// Triangle of a mesh; 0 for other shapes.
    pub element: u32,
    /// Index into [`Scene::instances`], or [`Hit::STATIC`].
    pub instance: u32,
    /// Barycentric coordinates of vertices 1 and 2, for triangles.
    pub barycentric: Vec2,
}

impl Hit {
    /// `instance` of what belongs to the static object.
    pub const STATIC: u32 = u32::MAX;
}

/// Everything shading needs to know of a point on a surface, in render space.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    pub position: Vec3,
    /// Bound on the absolute error of `position`, per axis (pbrt-v4, section 6.8).
    pub position_error: Vec3,
    /// Unit geometric normal: the side that an area light emits from. Not turned to the viewer.
    pub geometric_normal: Vec3,
    /// Unit interpolated normal, in the hemisphere of `geometric_normal`.
    pub shading_normal: Vec3,
    /// ∂p/∂u, perpendicular to nothing in particular; never zero.
    pub dpdu: Vec3,
    /// ∂p/∂v.
    pub dpdv: Vec3,
    pub uv: Vec2,
    /// Index into [`Scene::primitives`].
    pub primitive: u32,
    pub element: u32,
}

impl SurfacePoint {
    /// Origin for a ray that leaves in direction `w`, moved off the surface by the error bound.
    pub fn offset_origin(&self, w: Vec3) -> Vec3 {
        let _ = w;
        todo!()
    }
}

/// The acceleration structure over a scene.
pub struct Accel<'s> {
    scene: &'s Scene,
}

impl<'s> Accel<'s> {
    /// Builds it, on rayon's current pool.
    pub fn build(scene: &'s Scene) -> Self {
        Self { scene }
    }

    /// The nearest hit that is not cut out by alpha.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let _ = (self.scene, ray);
        todo!()
    }

    /// Whether anything lies between the ray's origin and `t_max`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let _ = ray;
        todo!()
    }

    /// The point of a hit.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let _ = (ray, hit);
        todo!()
    }

    /// Smallest box around everything at any time of the shutter, in render space;
    /// `None` if the scene has no geometry.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        todo!()
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        todo!()
    }
}
