//! From a hit to the point on the surface, in render space.

use glam::{DAffine3, DVec3};

use super::disk::DiskExtent;
use super::instances::transforms_at;
use super::local::LocalPoint;
use super::sphere::SphereExtent;
use super::{Hit, Ray, SurfacePoint, mesh};
use crate::scene::{Primitive, Scene, Shape};

/// The point at which `ray` hit.
pub fn surface_point(scene: &Scene, ray: &Ray, hit: &Hit) -> SurfacePoint {
    let primitive = &scene.primitives[hit.primitive as usize];
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let reached = origin + hit.t as f64 * direction;
    let local = match scene.instances.get(hit.instance as usize) {
        None => object_point(primitive, hit, reached),
        Some(instance) => {
            let (to_render, to_object) = transforms_at(&instance.transform, ray.time);
            object_point(primitive, hit, to_object.transform_point3(reached))
                .transformed(&to_render, &to_object)
        }
    };
    local.rounded(hit.primitive, hit.element)
}

/// The surface in the object's space; `near` is the hit as the ray gives it.
fn object_point(primitive: &Primitive, hit: &Hit, near: DVec3) -> LocalPoint {
    let flip = primitive.flip_normal;
    match &primitive.shape {
        Shape::Mesh(mesh) => mesh::local_point(mesh, hit.element, hit.barycentric, flip),
        Shape::Sphere(sphere) => {
            let extent = SphereExtent::of(sphere);
            quadric_point(&sphere.to_object, near, flip, |p| extent.local_point(extent.projected(p)))
        }
        Shape::Disk(disk) => {
            let extent = DiskExtent::of(disk);
            quadric_point(&disk.to_object, near, flip, |p| extent.local_point(extent.projected(p)))
        }
    }
}

/// The point that `surface` gives, in its shape's space, for one near it; in the object's space.
pub fn quadric_point(
    to_object: &DAffine3,
    near: DVec3,
    flip: bool,
    surface: impl Fn(DVec3) -> LocalPoint,
) -> LocalPoint {
    let to_shape = to_object.inverse();
    let point = surface(to_shape.transform_point3(near)).transformed(to_object, &to_shape);
    if flip { point.flipped() } else { point }
}
