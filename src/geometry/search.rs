//! Searches a scene's hierarchies along rays, with the widest instruction set of the processor.

use super::instances::{InstanceAccel, search_instances};
use super::kernels::{self, Kernels};
use super::object::{ObjectAccel, search_object};
use super::ray_query::RayQuery;
use super::stack::Stack;
use super::traversal_ray::TraversalRay;
use super::{Hit, Ray};
use crate::scene::Scene;

/// The two-level hierarchy over a scene.
pub struct SceneBvh<'s> {
    pub scene: &'s Scene,
    /// One for each of the scene's objects; the first is static.
    pub objects: Vec<ObjectAccel>,
    pub instances: InstanceAccel,
    /// Whether some primitive has an alpha texture.
    pub has_alpha: bool,
}

impl SceneBvh<'_> {
    /// Calls `found` with the nearest hit of each ray, in their order; with any of its hits if
    /// `any_hit`.
    #[inline]
    pub fn search(&self, rays: impl Iterator<Item = Ray>, any_hit: bool, found: impl FnMut(Option<Hit>)) {
        #[cfg(target_arch = "x86_64")]
        if crate::simd::has_avx2() {
            // SAFETY: the processor has every feature that `search_avx2` is compiled for, as has just
            // been checked. The `multiversion` crate would hide this, but its code does not build where
            // the compiler is told of AVX2 from the start (`-C target-cpu`).
            return unsafe { search_avx2(self, rays, any_hit, found) };
        }
        search_with(self, rays, any_hit, found, (kernels::intersect_boxes, kernels::intersect_triangles));
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn search_avx2(
    bvh: &SceneBvh,
    rays: impl Iterator<Item = Ray>,
    any_hit: bool,
    found: impl FnMut(Option<Hit>),
) {
    use super::{bvh::Node, triangle::TrianglePacket};

    let boxes = |node: &Node, ray: &TraversalRay| kernels::avx2::intersect_boxes(node, ray);
    let triangles =
        |packet: &TrianglePacket, ray: &TraversalRay| kernels::avx2::intersect_triangles(packet, ray);
    search_with(bvh, rays, any_hit, found, (boxes, triangles));
}

#[inline(always)]
fn search_with(
    bvh: &SceneBvh,
    rays: impl Iterator<Item = Ray>,
    any_hit: bool,
    mut found: impl FnMut(Option<Hit>),
    kernels: impl Kernels,
) {
    let mut stack = Stack::new();
    for ray in rays {
        found(search_ray(bvh, &ray, any_hit, &mut stack, kernels));
    }
}

#[inline(always)]
fn search_ray(
    bvh: &SceneBvh,
    ray: &Ray,
    any_hit: bool,
    stack: &mut Stack,
    kernels: impl Kernels,
) -> Option<Hit> {
    let mut traversal_ray = TraversalRay::new(ray.origin, ray.direction, ray.t_max)?;
    let mut query = RayQuery { scene: bvh.scene, has_alpha: bvh.has_alpha, ray, any_hit, hit: None };
    if let Some(static_object) = bvh.objects.first() {
        search_object(static_object, Hit::STATIC, &mut traversal_ray, &mut query, stack, kernels);
    }
    if !query.is_settled() && !bvh.instances.is_empty() {
        search_instances(&bvh.instances, &bvh.objects, &mut traversal_ray, &mut query, stack, kernels);
    }
    query.hit
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;
    use crate::geometry::Accel;
    use crate::geometry::test_scenes::{Rng, closed_sphere_mesh, instanced, ray, sphere, static_scene};
    use crate::scene::{AnimatedTransform, Shape};

    /// Vector and portable code agree to the last bit, also for rays at vertices and within the
    /// planes of boxes.
    #[test]
    fn every_instruction_set_finds_the_same() {
        let mesh = closed_sphere_mesh(Vec3::ZERO, 1.0, 40, 60);
        let shift = DAffine3::from_translation(DVec3::new(0.1, 0.2, 0.3));
        let scenes = [
            static_scene(vec![Shape::Mesh(mesh.clone()), sphere(Vec3::X, 0.7)]),
            instanced(Shape::Mesh(mesh.clone()), vec![AnimatedTransform::fixed(shift)]),
        ];
        for scene in &scenes {
            let accel = Accel::build(scene);
            let mut rng = Rng::new(11);
            let mut rays = Vec::new();
            for step in 0..4000 {
                let origin = if step % 4 == 0 { Vec3::ZERO } else { rng.in_cube(2.0) };
                let vertex = mesh.positions[step % mesh.positions.len()];
                let direction = if step % 2 == 0 { vertex - origin } else { rng.direction() };
                rays.push(ray(origin, direction));
            }
            for any_hit in [false, true] {
                let (mut fast, mut portable) = (Vec::new(), Vec::new());
                let bits = |hit: Option<Hit>| {
                    hit.map(|hit| (hit.t.to_bits(), hit.primitive, hit.element, hit.barycentric))
                };
                let bvh = accel.bvh();
                bvh.search(rays.iter().copied(), any_hit, |hit| fast.push(bits(hit)));
                let kernels = (kernels::intersect_boxes, kernels::intersect_triangles);
                search_with(bvh, rays.iter().copied(), any_hit, |hit| portable.push(bits(hit)), kernels);
                assert_eq!(fast, portable);
                let hits = fast.iter().flatten().count();
                assert!(hits > 1500, "{hits}");
            }
        }
    }
}
