//! Computes the surface interaction at a hit, in render space.

use glam::DVec3;

use super::instances::transforms_at;
use super::local_interaction::{Detail, LocalInteraction};
use super::object::ObjectAccel;
use super::{Hit, Ray, SurfaceInteraction, mesh};
use crate::scene::{Scene, Shape};

/// The surface where `ray` hit. `objects` has one entry for each of the scene's objects.
#[inline]
pub fn interaction(
    scene: &Scene,
    objects: &[ObjectAccel],
    ray: &Ray,
    hit: &Hit,
    detail: Detail,
) -> SurfaceInteraction {
    let along_ray = || ray.origin.as_dvec3() + hit.t as f64 * ray.direction.as_dvec3();
    let (local, element) = if hit.instance == Hit::STATIC {
        local_interaction(scene, &objects[0], hit, detail, along_ray)
    } else {
        let instance = &scene.instances[hit.instance as usize];
        let (to_render, to_object) = transforms_at(&instance.transform, ray.time);
        let in_object = || to_object.transform_point3(along_ray());
        let (local, element) = local_interaction(scene, &objects[instance.object], hit, detail, in_object);
        (local.transformed(&to_render, &to_object), element)
    };
    local.rounded(hit.primitive, element)
}

/// The surface in the object's space, and [`SurfaceInteraction::element`]. `approximate` gives the
/// position along the ray in the object's space, which spheres and disks refine.
#[inline]
fn local_interaction(
    scene: &Scene,
    object: &ObjectAccel,
    hit: &Hit,
    detail: Detail,
    approximate: impl FnOnce() -> DVec3,
) -> (LocalInteraction, u32) {
    let primitive = &scene.primitives[hit.primitive as usize];
    let flip = primitive.flip_normal;
    // An emitted image is looked up by texture coordinates, whatever the material needs.
    let emits_image = primitive.area_light.is_some_and(|light| light.image.is_some());
    let detail = if emits_image { Detail::All } else { detail };
    match &primitive.shape {
        Shape::Mesh(mesh) => {
            (mesh::interaction(mesh, hit.element, hit.barycentric, flip, detail), hit.element)
        }
        Shape::Sphere(_) | Shape::Disk(_) => {
            (object.quadric(hit.element).interaction(approximate(), flip, detail), 0)
        }
    }
}
