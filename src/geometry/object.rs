//! Acceleration structure of one object: a hierarchy for its triangles, one for the other shapes.

use glam::{DAffine3, Vec2, Vec3A};
use multiversion::{multiversion, target::match_target};
use obvhs::aabb::Aabb;

use super::bvh::{Bvh, NO_ITEM, Node, WIDTH};
use super::disk::{self, DiskExtent};
use super::kernels::{self, Entered};
use super::query::Query;
use super::sphere::{self, SphereExtent};
use super::traverse::{Leaves, TraversalRay, traverse};
use super::triangle::TrianglePacket;
use super::{Hit, mesh};
use crate::scene::{Object, Scene, Shape};

/// Coordinates beyond this are dropped: products of three no longer fit single precision.
const LARGEST_COORDINATE: f32 = 1e12;

/// A triangle of a primitive.
#[derive(Clone, Copy, Debug)]
struct TriangleId {
    primitive: u32,
    triangle: u32,
}

/// A sphere or disk, ready for intersection.
#[derive(Clone, Copy, Debug)]
struct Quadric {
    primitive: u32,
    to_shape: DAffine3,
    extent: QuadricExtent,
}

#[derive(Clone, Copy, Debug)]
enum QuadricExtent {
    Sphere(SphereExtent),
    Disk(DiskExtent),
}

impl Quadric {
    /// Where a ray in the object's space meets it, in order; NaN for none.
    fn distances(&self, ray: &TraversalRay) -> [f32; 2] {
        let origin = self.to_shape.transform_point3(ray.origin.as_dvec3());
        let direction = self.to_shape.transform_vector3(ray.direction.as_dvec3());
        match self.extent {
            QuadricExtent::Sphere(sphere) => sphere.distances(origin, direction),
            QuadricExtent::Disk(disk) => [disk.distance(origin, direction), f64::NAN],
        }
        .map(|t| t as f32)
    }

    fn uv(&self, ray: &TraversalRay, t: f32) -> Vec2 {
        let p = self.to_shape.transform_point3((ray.origin + t * ray.direction).as_dvec3());
        match self.extent {
            QuadricExtent::Sphere(sphere) => sphere.local_point(sphere.projected(p)).uv,
            QuadricExtent::Disk(disk) => disk.local_point(disk.projected(p)).uv,
        }
    }
}

/// An object, in its own space.
#[derive(Debug)]
pub struct ObjectAccel {
    triangles: Bvh,
    /// One for each leaf of `triangles`.
    packets: Vec<TrianglePacket>,
    /// [`WIDTH`] for each packet.
    triangle_ids: Vec<TriangleId>,
    quadrics: Bvh,
    /// One for each leaf of `quadrics`.
    quadric_tests: Vec<Quadric>,
}

impl ObjectAccel {
    pub fn build(scene: &Scene, object: &Object) -> Self {
        let mut ids = Vec::new();
        let mut boxes = Vec::new();
        let mut quadrics = Vec::new();
        let mut quadric_boxes = Vec::new();
        for primitive in object.primitives.clone().filter(|&index| index < scene.primitives.len()) {
            let index = primitive as u32;
            let mut add_quadric = |bounds: Option<Aabb>, to_object: &DAffine3, extent| {
                if let Some(bounds) = bounds.filter(is_usable) {
                    quadrics.push(Quadric { primitive: index, to_shape: to_object.inverse(), extent });
                    quadric_boxes.push(bounds);
                }
            };
            match &scene.primitives[primitive].shape {
                Shape::Mesh(mesh) => {
                    for triangle in 0..mesh.indices.len() as u32 {
                        let corners = mesh::corners(mesh, triangle);
                        let bounds = Aabb::from_points(&corners.map(Vec3A::from));
                        let finite = corners.iter().all(|corner| corner.is_finite());
                        if finite && is_usable(&bounds) && mesh::scaled_normal(corners).length_squared() > 0.0
                        {
                            ids.push(TriangleId { primitive: index, triangle });
                            boxes.push(bounds);
                        }
                    }
                }
                Shape::Sphere(shape) => add_quadric(
                    sphere::bounds(shape),
                    &shape.to_object,
                    QuadricExtent::Sphere(SphereExtent::of(shape)),
                ),
                Shape::Disk(shape) => add_quadric(
                    disk::bounds(shape),
                    &shape.to_object,
                    QuadricExtent::Disk(DiskExtent::of(shape)),
                ),
            }
        }

        let triangles = Bvh::build(&boxes, WIDTH);
        let mut packets = vec![TrianglePacket::EMPTY; triangles.slots.len() / WIDTH];
        let mut triangle_ids = Vec::with_capacity(triangles.slots.len());
        for (slot, &item) in triangles.slots.iter().enumerate() {
            let absent = TriangleId { primitive: NO_ITEM, triangle: NO_ITEM };
            let id = if item == NO_ITEM { absent } else { ids[item as usize] };
            triangle_ids.push(id);
            if item != NO_ITEM
                && let Shape::Mesh(mesh) = &scene.primitives[id.primitive as usize].shape
            {
                packets[slot / WIDTH].set(slot % WIDTH, mesh::corners(mesh, id.triangle));
            }
        }
        let quadric_bvh = Bvh::build(&quadric_boxes, 1);
        let quadric_tests = quadric_bvh.slots.iter().map(|&item| quadrics[item as usize]).collect();
        Self { triangles, packets, triangle_ids, quadrics: quadric_bvh, quadric_tests }
    }

    /// The box around everything, or `None` if there is nothing.
    pub fn bounds(&self) -> Option<Aabb> {
        let both = self.triangles.bounds.union(&self.quadrics.bounds);
        both.valid().then_some(both)
    }

    pub fn memory_bytes(&self) -> usize {
        self.triangles.memory_bytes()
            + self.quadrics.memory_bytes()
            + size_of_val(&*self.packets)
            + size_of_val(&*self.triangle_ids)
            + size_of_val(&*self.quadric_tests)
    }
}

fn is_usable(bounds: &Aabb) -> bool {
    bounds.valid() && bounds.min.abs().max(bounds.max.abs()).max_element() <= LARGEST_COORDINATE
}

/// Searches an object along a ray in its space; `instance` is what hits are labelled with.
#[multiversion(targets("x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"))]
pub fn search(object: &ObjectAccel, instance: u32, ray: &mut TraversalRay, query: &mut Query) {
    match_target! {
        "x86_64+avx2" => search_with(
            object,
            instance,
            ray,
            query,
            |node: &Node, ray: &TraversalRay| kernels::avx2::enter(node, ray),
            |packet: &TrianglePacket, ray: &TraversalRay| kernels::avx2::candidates(packet, ray),
        ),
        _ => search_with(object, instance, ray, query, kernels::enter, kernels::candidates),
    }
}

/// [`search`] with given kernels.
#[inline(always)]
fn search_with(
    object: &ObjectAccel,
    instance: u32,
    ray: &mut TraversalRay,
    query: &mut Query,
    enter: impl Fn(&Node, &TraversalRay) -> Entered,
    candidates: impl Fn(&TrianglePacket, &TraversalRay) -> u32,
) {
    traverse(&object.triangles, ray, &enter, &mut TriangleLeaves { object, instance, query, candidates });
    if !(query.any && query.hit.is_some()) {
        traverse(&object.quadrics, ray, &enter, &mut QuadricLeaves { object, instance, query });
    }
}

struct TriangleLeaves<'a, 'q, C> {
    object: &'a ObjectAccel,
    instance: u32,
    query: &'a mut Query<'q>,
    candidates: C,
}

impl<C: Fn(&TrianglePacket, &TraversalRay) -> u32> Leaves for TriangleLeaves<'_, '_, C> {
    #[inline(always)]
    fn test(&mut self, leaf: u32, ray: &mut TraversalRay) -> bool {
        let packet = &self.object.packets[leaf as usize];
        let mut candidates = (self.candidates)(packet, ray);
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize % WIDTH;
            candidates &= candidates - 1;
            let Some(found) = packet.hit(ray, lane) else { continue };
            let id = self.object.triangle_ids[leaf as usize * WIDTH + lane];
            let hit = Hit {
                t: found.t,
                primitive: id.primitive,
                element: id.triangle,
                instance: self.instance,
                barycentric: found.barycentric,
            };
            if self.query.accept(hit, || Vec2::ZERO) {
                ray.t_max = found.t;
                if self.query.any {
                    return true;
                }
            }
        }
        false
    }
}

struct QuadricLeaves<'a, 'q> {
    object: &'a ObjectAccel,
    instance: u32,
    query: &'a mut Query<'q>,
}

impl Leaves for QuadricLeaves<'_, '_> {
    #[inline(always)]
    fn test(&mut self, leaf: u32, ray: &mut TraversalRay) -> bool {
        let quadric = &self.object.quadric_tests[leaf as usize];
        for t in quadric.distances(ray) {
            // NaN is no hit.
            if t > 0.0 && t < ray.t_max {
                let hit = Hit {
                    t,
                    primitive: quadric.primitive,
                    element: 0,
                    instance: self.instance,
                    barycentric: Vec2::ZERO,
                };
                if self.query.accept(hit, || quadric.uv(ray, t)) {
                    ray.t_max = t;
                }
            }
        }
        self.query.any && self.query.hit.is_some()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::geometry::test_scenes::{Numbers, closed_sphere_mesh, ray, scene_of, sphere};

    /// What the machine's vectors find is what the portable code finds, to the last bit; also for
    /// rays at vertices and within the planes of boxes.
    #[test]
    fn every_instruction_set_finds_the_same() {
        let mesh = closed_sphere_mesh(Vec3::ZERO, 1.0, 40, 60);
        let scene = scene_of(vec![Shape::Mesh(mesh.clone()), sphere(Vec3::X, 0.7)]);
        let object = ObjectAccel::build(&scene, &scene.objects[0]);
        let mut numbers = Numbers::new(11);
        let mut hits = 0;
        for step in 0..4000 {
            let origin = if step % 4 == 0 { Vec3::ZERO } else { numbers.in_cube(2.0) };
            let vertex = mesh.positions[step % mesh.positions.len()];
            let direction = if step % 2 == 0 { vertex - origin } else { numbers.direction() };
            let ray = ray(origin, direction);
            let Some(walk) = TraversalRay::new(ray.origin, ray.direction, ray.t_max) else { continue };
            for any in [false, true] {
                let [fast, portable] = [true, false].map(|vectors| {
                    let (mut walk, mut query) = (walk, Query { scene: &scene, ray: &ray, any, hit: None });
                    if vectors {
                        search(&object, Hit::STATIC, &mut walk, &mut query);
                    } else {
                        let (enter, test) = (kernels::enter, kernels::candidates);
                        search_with(&object, Hit::STATIC, &mut walk, &mut query, enter, test);
                    }
                    query.hit.map(|hit| (hit.t.to_bits(), hit.primitive, hit.element, hit.barycentric))
                });
                assert_eq!(fast, portable, "{ray:?}");
                hits += fast.is_some() as u32;
            }
        }
        assert!(hits > 3000, "{hits}");
    }
}
