//! A sphere or disk with its transform, ready for intersection.

use glam::{DAffine3, DVec3, Vec2};
use obvhs::aabb::Aabb;

use super::disk::{self, DiskExtent};
use super::local_interaction::{Detail, LocalInteraction};
use super::sphere::{self, SphereExtent};
use super::traversal_ray::TraversalRay;
use crate::scene::Shape;

/// A sphere or disk of an object.
#[derive(Clone, Copy, Debug)]
pub struct Quadric {
    /// Index into [`crate::scene::Scene::primitives`].
    pub primitive: u32,
    pub(super) to_object: DAffine3,
    to_shape: DAffine3,
    pub(super) extent: Extent,
}

/// A full or partial sphere with its transform to the object's space, and the inverse.
#[derive(Clone, Copy, Debug)]
pub struct TransformedSphere {
    pub extent: SphereExtent,
    pub to_object: DAffine3,
    pub to_shape: DAffine3,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Extent {
    Sphere(SphereExtent),
    Disk(DiskExtent),
}

impl Quadric {
    /// The quadric with its box in the object's space; `None` for meshes and for shapes that are not
    /// finite.
    pub fn new(primitive: u32, shape: &Shape) -> Option<(Self, Aabb)> {
        let (bounds, to_object, extent) = match shape {
            Shape::Mesh(_) => return None,
            Shape::Sphere(shape) => {
                (sphere::bounds(shape)?, shape.to_object, Extent::Sphere(SphereExtent::new(shape)))
            }
            Shape::Disk(shape) => {
                (disk::bounds(shape)?, shape.to_object, Extent::Disk(DiskExtent::new(shape)))
            }
        };
        Some((Self { primitive, to_object, to_shape: to_object.inverse(), extent }, bounds))
    }

    /// Distances along a ray in the object's space to the surface, in ascending order; NaN for no hit.
    #[inline]
    pub fn distances(&self, ray: &TraversalRay) -> [f32; 2] {
        let origin = self.to_shape.transform_point3(ray.origin.as_dvec3());
        let direction = self.to_shape.transform_vector3(ray.direction.as_dvec3());
        match self.extent {
            Extent::Sphere(sphere) => sphere.distances(origin, direction),
            Extent::Disk(disk) => [disk.distance(origin, direction), f64::NAN],
        }
        .map(|t| t as f32)
    }

    /// Transform from the object's to the sphere's space and radius, if this is a full sphere.
    pub fn full_sphere(&self) -> Option<(DAffine3, f64)> {
        match self.extent {
            Extent::Sphere(sphere) if sphere.is_full() => Some((self.to_shape, sphere.radius)),
            Extent::Sphere(_) | Extent::Disk(_) => None,
        }
    }

    /// The sphere, full or partial; `None` for a disk.
    pub fn sphere(&self) -> Option<TransformedSphere> {
        match self.extent {
            Extent::Sphere(extent) => {
                Some(TransformedSphere { extent, to_object: self.to_object, to_shape: self.to_shape })
            }
            Extent::Disk(_) => None,
        }
    }

    /// Texture coordinates at distance `t` along a ray in the object's space.
    pub fn uv(&self, ray: &TraversalRay, t: f32) -> Vec2 {
        let point = self.shape_interaction((ray.origin + t * ray.direction).as_dvec3(), Detail::All);
        point.parametrisation.map_or(Vec2::ZERO, |parametrisation| parametrisation.uv)
    }

    /// The surface closest to the point `near`, both in the object's space.
    #[inline]
    pub fn interaction(&self, near: DVec3, flip: bool, detail: Detail) -> LocalInteraction {
        self.in_object(self.shape_interaction(near, detail), flip)
    }

    /// The surface, in the object's space, at a point on it in the shape's space.
    pub(super) fn interaction_at(&self, p: DVec3, flip: bool, detail: Detail) -> LocalInteraction {
        let local = match &self.extent {
            Extent::Sphere(sphere) => sphere.interaction(p, detail),
            Extent::Disk(disk) => disk.interaction(p, detail),
        };
        self.in_object(local, flip)
    }

    #[inline]
    fn in_object(&self, local: LocalInteraction, flip: bool) -> LocalInteraction {
        let point = local.transformed_in_double(&self.to_object, &self.to_shape);
        if flip { point.flipped() } else { point }
    }

    /// The surface in the shape's space closest to the point `near` of the object's space.
    #[inline]
    fn shape_interaction(&self, near: DVec3, detail: Detail) -> LocalInteraction {
        let p = self.to_shape.transform_point3(near);
        match &self.extent {
            Extent::Sphere(sphere) => sphere.interaction(sphere.projected(p), detail),
            Extent::Disk(disk) => disk.interaction(disk.projected(p), detail),
        }
    }
}
