//! The search along rays through a whole scene, in the instruction set that the processor has.

use super::instances::search_instances;
use super::kernels::{self, Kernels};
use super::object::search;
use super::query::Query;
use super::traverse::{Stack, TraversalRay};
use super::{Accel, Hit, Ray};

/// Passes on the nearest hit of each ray; of any hit if `any` will do.
#[inline]
pub fn find(accel: &Accel, rays: impl Iterator<Item = Ray>, any: bool, found: impl FnMut(Option<Hit>)) {
    #[cfg(target_arch = "x86_64")]
    if has_avx2() {
        // SAFETY: the processor has all that `find_avx2` is compiled for, as has just been checked. The
        // `multiversion` crate would hide this, but its code does not build where the compiler is told of
        // AVX2 from the start (`-C target-cpu`).
        return unsafe { find_avx2(accel, rays, any, found) };
    }
    find_with(accel, rays, any, found, (kernels::enter, kernels::candidates));
}

#[cfg(target_arch = "x86_64")]
#[inline]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn find_avx2(accel: &Accel, rays: impl Iterator<Item = Ray>, any: bool, found: impl FnMut(Option<Hit>)) {
    use super::{bvh::Node, triangle::TrianglePacket};

    let enter = |node: &Node, ray: &TraversalRay| kernels::avx2::enter(node, ray);
    let candidates = |packet: &TrianglePacket, ray: &TraversalRay| kernels::avx2::candidates(packet, ray);
    find_with(accel, rays, any, found, (enter, candidates));
}

#[inline(always)]
fn find_with(
    accel: &Accel,
    rays: impl Iterator<Item = Ray>,
    any: bool,
    mut found: impl FnMut(Option<Hit>),
    kernels: impl Kernels,
) {
    let mut stack = Stack::new();
    for ray in rays {
        found(find_one(accel, &ray, any, &mut stack, kernels));
    }
}

#[inline(always)]
fn find_one(accel: &Accel, ray: &Ray, any: bool, stack: &mut Stack, kernels: impl Kernels) -> Option<Hit> {
    let mut walk = TraversalRay::new(ray.origin, ray.direction, ray.t_max)?;
    let mut query = Query { scene: accel.scene, has_alpha: accel.has_alpha, ray, any, hit: None };
    if let Some(fixed) = accel.objects.first() {
        search(fixed, Hit::STATIC, &mut walk, &mut query, stack, kernels);
    }
    let settled = any && query.hit.is_some();
    if !settled && !accel.instances.is_empty() {
        search_instances(&accel.instances, &accel.objects, &mut walk, &mut query, stack, kernels);
    }
    query.hit
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;
    use crate::geometry::test_scenes::{Numbers, closed_sphere_mesh, instanced, ray, scene_of, sphere};
    use crate::scene::{AnimatedTransform, Shape};

    /// What the machine's vectors find is what the portable code finds, to the last bit; also for
    /// rays at vertices and within the planes of boxes.
    #[test]
    fn every_instruction_set_finds_the_same() {
        let mesh = closed_sphere_mesh(Vec3::ZERO, 1.0, 40, 60);
        let shift = DAffine3::from_translation(DVec3::new(0.1, 0.2, 0.3));
        let scenes = [
            scene_of(vec![Shape::Mesh(mesh.clone()), sphere(Vec3::X, 0.7)]),
            instanced(Shape::Mesh(mesh.clone()), vec![AnimatedTransform::fixed(shift)]),
        ];
        for scene in &scenes {
            let accel = Accel::build(scene);
            let mut numbers = Numbers::new(11);
            let mut rays = Vec::new();
            for step in 0..4000 {
                let origin = if step % 4 == 0 { Vec3::ZERO } else { numbers.in_cube(2.0) };
                let vertex = mesh.positions[step % mesh.positions.len()];
                let direction = if step % 2 == 0 { vertex - origin } else { numbers.direction() };
                rays.push(ray(origin, direction));
            }
            for any in [false, true] {
                let (mut fast, mut portable) = (Vec::new(), Vec::new());
                let bits = |hit: Option<Hit>| {
                    hit.map(|hit| (hit.t.to_bits(), hit.primitive, hit.element, hit.barycentric))
                };
                find(&accel, rays.iter().copied(), any, |hit| fast.push(bits(hit)));
                let kernels = (kernels::enter, kernels::candidates);
                find_with(&accel, rays.iter().copied(), any, |hit| portable.push(bits(hit)), kernels);
                assert_eq!(fast, portable);
                let hits = fast.iter().flatten().count();
                assert!(hits > 1500, "{hits}");
            }
        }
    }
}
