//! From a hit to the point on the surface, in render space.

use glam::DVec3;

use super::instances::transforms_at;
use super::local::{Detail, LocalPoint};
use super::object::ObjectAccel;
use super::{Hit, Ray, SurfacePoint, mesh};
use crate::scene::{Scene, Shape};

/// The point at which `ray` hit. `objects` are indexed as the scene's.
#[inline]
pub fn surface_point(
    scene: &Scene,
    objects: &[ObjectAccel],
    ray: &Ray,
    hit: &Hit,
    detail: Detail,
) -> SurfacePoint {
    let reached = || ray.origin.as_dvec3() + hit.t as f64 * ray.direction.as_dvec3();
    let (point, element) = if hit.instance == Hit::STATIC {
        local_point(scene, &objects[0], hit, detail, reached)
    } else {
        let instance = &scene.instances[hit.instance as usize];
        let (to_render, to_object) = transforms_at(&instance.transform, ray.time);
        let near = || to_object.transform_point3(reached());
        let (point, element) = local_point(scene, &objects[instance.object], hit, detail, near);
        (point.transformed(&to_render, &to_object), element)
    };
    point.rounded(hit.primitive, element)
}

/// The surface in the object's space, and [`SurfacePoint::element`]; `near` is the hit as the ray
/// gives it.
#[inline]
fn local_point(
    scene: &Scene,
    object: &ObjectAccel,
    hit: &Hit,
    detail: Detail,
    near: impl FnOnce() -> DVec3,
) -> (LocalPoint, u32) {
    let primitive = &scene.primitives[hit.primitive as usize];
    let flip = primitive.flip_normal;
    // An image that is emitted is looked up by texture coordinates, whatever the material.
    let shows_image = primitive.area_light.is_some_and(|light| light.image.is_some());
    let detail = if shows_image { Detail::Full } else { detail };
    match &primitive.shape {
        Shape::Mesh(mesh) => {
            (mesh::local_point(mesh, hit.element, hit.barycentric, flip, detail), hit.element)
        }
        Shape::Sphere(_) | Shape::Disk(_) => {
            (object.quadric(hit.element).local_point(near(), flip, detail), 0)
        }
    }
}
