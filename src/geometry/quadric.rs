//! A sphere or disk, ready for intersection: its shape's space, and the way there and back.

use glam::{DAffine3, DVec3, Vec2};
use obvhs::aabb::Aabb;

use super::disk::{self, DiskExtent};
use super::local::{Detail, LocalPoint};
use super::sphere::{self, SphereExtent};
use super::traverse::TraversalRay;
use crate::scene::Shape;

#[derive(Clone, Copy, Debug)]
pub struct Quadric {
    /// Index into [`crate::scene::Scene::primitives`].
    pub primitive: u32,
    to_object: DAffine3,
    to_shape: DAffine3,
    extent: Extent,
}

/// A sphere in its object.
#[derive(Clone, Copy, Debug)]
pub struct PlacedSphere {
    pub extent: SphereExtent,
    pub to_object: DAffine3,
    pub to_shape: DAffine3,
}

#[derive(Clone, Copy, Debug)]
enum Extent {
    Sphere(SphereExtent),
    Disk(DiskExtent),
}

impl Quadric {
    /// The quadric with its box in the object's space; `None` for meshes, and what is not finite.
    pub fn new(primitive: u32, shape: &Shape) -> Option<(Self, Aabb)> {
        let (bounds, to_object, extent) = match shape {
            Shape::Mesh(_) => return None,
            Shape::Sphere(shape) => {
                (sphere::bounds(shape)?, shape.to_object, Extent::Sphere(SphereExtent::of(shape)))
            }
            Shape::Disk(shape) => {
                (disk::bounds(shape)?, shape.to_object, Extent::Disk(DiskExtent::of(shape)))
            }
        };
        Some((Self { primitive, to_object, to_shape: to_object.inverse(), extent }, bounds))
    }

    /// Where a ray in the object's space meets it, in order; NaN for none.
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

    /// The way to its own space and its radius, if it is a sphere of which nothing is missing.
    pub fn whole_sphere(&self) -> Option<(DAffine3, f64)> {
        match self.extent {
            Extent::Sphere(sphere) if sphere.is_full() => Some((self.to_shape, sphere.radius)),
            Extent::Sphere(_) | Extent::Disk(_) => None,
        }
    }

    /// If it is a sphere, or a part of one.
    pub fn sphere(&self) -> Option<PlacedSphere> {
        match self.extent {
            Extent::Sphere(extent) => {
                Some(PlacedSphere { extent, to_object: self.to_object, to_shape: self.to_shape })
            }
            Extent::Disk(_) => None,
        }
    }

    pub fn uv(&self, ray: &TraversalRay, t: f32) -> Vec2 {
        let point = self.shape_point((ray.origin + t * ray.direction).as_dvec3(), Detail::Full);
        point.parametrisation.map_or(Vec2::ZERO, |it| it.uv)
    }

    /// The surface at a point near it, all in the object's space.
    #[inline]
    pub fn local_point(&self, near: DVec3, flip: bool, detail: Detail) -> LocalPoint {
        let point = self.shape_point(near, detail).transformed(&self.to_object, &self.to_shape);
        if flip { point.flipped() } else { point }
    }

    /// The surface in its own space at a point of the object's space near it.
    #[inline]
    fn shape_point(&self, near: DVec3, detail: Detail) -> LocalPoint {
        let p = self.to_shape.transform_point3(near);
        match &self.extent {
            Extent::Sphere(sphere) => sphere.local_point(sphere.projected(p), detail),
            Extent::Disk(disk) => disk.local_point(disk.projected(p), detail),
        }
    }
}
