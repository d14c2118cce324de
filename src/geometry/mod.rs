//! Acceleration structure and intersection: instances, motion, robust offsets.
//!
//! Knows nothing of shading; the one thing it asks of the scene beyond shapes is the alpha
//! texture of cut-out surfaces.

mod bvh;
mod disk;
mod flat;
mod instances;
mod kernels;
mod lanes;
mod local;
mod mesh;
mod object;
mod points;
mod quadric;
mod query;
mod rounding;
mod sampling;
mod search;
mod sphere;
mod surface;
#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod tests;
mod traverse;
mod triangle;
mod triangle_sampling;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::scene::{Scene, Shape};
use flat::FlatAccel;
use instances::InstanceAccel;
pub use lanes::{HitLanes, LANES, Lanes, Lanes3, PointLanes, RayLanes, groups, lanes_of, mask_of};
use local::Detail;
use object::ObjectAccel;
pub use rounding::offset_origin;
pub use sampling::{ShapeSample, area, pdf_shape, sample_shape};
pub(crate) use traverse::prefetch;
pub use triangle_sampling::TriangleSampler;

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
    /// Triangle of a mesh; for other shapes what only this room understands.
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
    /// Triangle of a mesh; 0 for other shapes.
    pub element: u32,
}

impl SurfacePoint {
    /// Origin for a ray that leaves in direction `w`, moved off the surface by the error bound.
    pub fn offset_origin(&self, w: Vec3) -> Vec3 {
        rounding::offset_origin(self.position, self.position_error, self.geometric_normal, w)
    }
}

/// The acceleration structure over a scene.
pub struct Accel<'s> {
    scene: &'s Scene,
    /// As the scene's.
    objects: Vec<ObjectAccel>,
    instances: InstanceAccel,
    /// All of the scene once more, if there is little.
    flat: Option<FlatAccel>,
    /// Some primitive has an alpha texture.
    has_alpha: bool,
}

impl<'s> Accel<'s> {
    /// Builds it, on rayon's current pool. Triangles without area and whatever is not finite are
    /// left out.
    pub fn build(scene: &'s Scene) -> Self {
        let objects: Vec<_> =
            scene.objects.par_iter().map(|object| ObjectAccel::build(scene, object)).collect();
        let instances = InstanceAccel::build(scene, &objects);
        let has_alpha = scene.primitives.iter().any(|primitive| primitive.alpha.is_some());
        let fixed = objects.first().filter(|_| instances.is_empty() && !has_alpha);
        let flat = fixed.and_then(FlatAccel::of);
        Self { scene, objects, instances, flat, has_alpha }
    }

    /// The nearest hit that is not cut out by alpha.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut hit = None;
        search::find(self, std::iter::once(*ray), false, |found| hit = found);
        hit
    }

    /// [`Self::intersect`] for many rays, which is faster than one by one: passes on the hit of
    /// each, in their order.
    #[inline]
    pub fn intersect_all(&self, mut rays: impl Iterator<Item = Ray>, mut found: impl FnMut(Option<Hit>)) {
        if self.flat.is_none() {
            return search::find(self, rays, false, found);
        }
        let (mut packet, mut hits) = (RayLanes::NONE, HitLanes::NONE);
        loop {
            let mut count = 0;
            for (lane, ray) in rays.by_ref().take(LANES).enumerate() {
                packet.set(lane, ray);
                count += 1;
            }
            if count == 0 {
                return;
            }
            self.intersect_lanes(&packet, count, &mut hits);
            (0..count).for_each(|lane| found(hits.at(lane)));
        }
    }

    /// [`Self::intersect`] for the first `count` of some rays in lanes.
    #[inline]
    pub fn intersect_lanes(&self, rays: &RayLanes, count: usize, hits: &mut HitLanes) {
        if let Some(flat) = &self.flat {
            return flat.find(rays, count, |ray| self.intersect(ray), hits);
        }
        let mut lanes = 0..count;
        search::find(self, (0..count).map(|lane| rays.at(lane)), false, |hit| {
            lanes.by_ref().take(1).for_each(|lane| hits.set(lane, hit));
        });
    }

    /// Whether anything lies between the ray's origin and `t_max`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut hit = None;
        search::find(self, std::iter::once(*ray), true, |found| hit = found);
        hit.is_some()
    }

    /// [`Self::occluded`] for many rays, as [`Self::intersect_all`].
    #[inline]
    pub fn occluded_all(&self, rays: impl Iterator<Item = Ray>, mut found: impl FnMut(bool)) {
        match &self.flat {
            Some(_) => self.intersect_all(rays, |hit| found(hit.is_some())),
            None => search::find(self, rays, true, |hit| found(hit.is_some())),
        }
    }

    /// [`Self::occluded`] for the first `count` of some rays in lanes: the mask of those for which it
    /// holds.
    #[inline]
    pub fn occluded_lanes(&self, rays: &RayLanes, count: usize) -> u32 {
        if let Some(flat) = &self.flat {
            return flat.find_blocked(rays, count, |ray| self.occluded(ray));
        }
        let (mut mask, mut lane) = (0, 0);
        self.occluded_all((0..count).map(|lane| rays.at(lane)), |occluded| {
            mask |= u32::from(occluded) << lane;
            lane += 1;
        });
        mask
    }

    /// The point of a hit.
    #[inline]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        surface::surface_point(self.scene, &self.objects, ray, hit, Detail::Full)
    }

    /// The point of a hit without its parametrisation, which takes half of the work: texture
    /// coordinates are 0 unless an image is emitted there, and tangents any that are perpendicular to
    /// the normal.
    #[inline]
    pub fn plain_surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        surface::surface_point(self.scene, &self.objects, ray, hit, Detail::Plain)
    }

    /// [`Self::plain_surface`] for the lanes of a mask.
    #[inline]
    pub fn plain_surfaces(&self, rays: &RayLanes, hits: &HitLanes, mask: u32, points: &mut PointLanes) {
        points::plain_points(self.scene, &self.objects, rays, hits, mask, points);
    }

    /// Texture coordinates of a hit on a triangle of a mesh; 0 on other shapes.
    #[inline]
    pub fn uv_of_triangle(&self, hit: &Hit) -> Vec2 {
        match &self.scene.primitives[hit.primitive as usize].shape {
            Shape::Mesh(mesh) => mesh::uv(mesh, hit.element, hit.barycentric),
            Shape::Sphere(_) | Shape::Disk(_) => Vec2::ZERO,
        }
    }

    /// Smallest box around everything at any time of the shutter, in render space;
    /// `None` if the scene has no geometry.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let fixed = self.objects.first().and_then(ObjectAccel::bounds);
        let all = fixed.map_or(self.instances.bounds(), |bounds| bounds.union(&self.instances.bounds()));
        all.valid().then(|| (all.min.into(), all.max.into()))
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.instances.memory_bytes() + self.objects.iter().map(ObjectAccel::memory_bytes).sum::<usize>()
    }
}
