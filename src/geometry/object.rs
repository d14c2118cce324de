//! Acceleration structure of one object: a hierarchy for its triangles, one for the other shapes.

use glam::{Vec2, Vec3, Vec3A};
use obvhs::aabb::Aabb;

use super::bvh::{Bvh, NO_ITEM, Node, WIDTH};
use super::kernels::Kernels;
use super::quadric::Quadric;
use super::query::Query;
use super::traverse::{Leaves, Stack, TraversalRay, prefetch, traverse};
use super::triangle::TrianglePacket;
use super::{Hit, mesh};
use crate::scene::shape::LARGEST_COORDINATE;
use crate::scene::{Object, Scene, Shape};

/// A triangle of a primitive.
#[derive(Clone, Copy, Debug)]
struct TriangleId {
    primitive: u32,
    triangle: u32,
}

/// The triangles of a packet, in one line of the cache.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct PacketIds([TriangleId; WIDTH]);

/// An object, in its own space.
#[derive(Debug)]
pub struct ObjectAccel {
    triangles: Bvh,
    /// One for each leaf of `triangles`.
    packets: Vec<TrianglePacket>,
    /// One for each of `packets`.
    packet_ids: Vec<PacketIds>,
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
            let shape = &scene.primitives[primitive].shape;
            if let Some((quadric, bounds)) =
                Quadric::new(index, shape).filter(|(_, bounds)| is_usable(bounds))
            {
                quadrics.push(quadric);
                quadric_boxes.push(bounds);
            }
            let Shape::Mesh(mesh) = shape else { continue };
            for triangle in 0..mesh.indices.len() as u32 {
                let corners = mesh::corners(mesh, triangle);
                let bounds = Aabb::from_points(&corners.map(Vec3A::from));
                let finite = corners.iter().all(|corner| corner.is_finite());
                if finite && is_usable(&bounds) && mesh::scaled_normal(corners).length_squared() > 0.0 {
                    ids.push(TriangleId { primitive: index, triangle });
                    boxes.push(bounds);
                }
            }
        }

        let triangles = Bvh::build(&boxes, WIDTH);
        let absent = PacketIds([TriangleId { primitive: NO_ITEM, triangle: NO_ITEM }; WIDTH]);
        let mut packets = vec![TrianglePacket::EMPTY; triangles.slots.len() / WIDTH];
        let mut packet_ids = vec![absent; packets.len()];
        for (slot, &item) in triangles.slots.iter().enumerate().filter(|&(_, &item)| item != NO_ITEM) {
            let id = ids[item as usize];
            packet_ids[slot / WIDTH].0[slot % WIDTH] = id;
            if let Shape::Mesh(mesh) = &scene.primitives[id.primitive as usize].shape {
                packets[slot / WIDTH].set(slot % WIDTH, mesh::corners(mesh, id.triangle));
            }
        }
        let quadric_bvh = Bvh::build(&quadric_boxes, 1);
        let quadric_tests = quadric_bvh.slots.iter().map(|&item| quadrics[item as usize]).collect();
        Self { triangles, packets, packet_ids, quadrics: quadric_bvh, quadric_tests }
    }

    /// The box around everything, or `None` if there is nothing.
    pub fn bounds(&self) -> Option<Aabb> {
        let both = self.triangles.bounds.union(&self.quadrics.bounds);
        both.valid().then_some(both)
    }

    /// The triangles: corners, primitive, and number in its mesh.
    pub fn triangles(&self) -> impl Iterator<Item = ([Vec3; 3], u32, u32)> {
        let ids = self.packet_ids.iter().flat_map(|ids| &ids.0).enumerate();
        let ids = ids.filter(|(_, id)| id.primitive != NO_ITEM);
        ids.map(|(slot, id)| {
            let corners = self.packets[slot / WIDTH].corners;
            let corners = corners.map(|planes| Vec3::from_array(planes.map(|plane| plane[slot % WIDTH])));
            (corners, id.primitive, id.triangle)
        })
    }

    /// The other shapes, by [`Hit::element`].
    pub fn quadrics(&self) -> &[Quadric] {
        &self.quadric_tests
    }

    /// By [`Hit::element`].
    #[inline]
    pub fn quadric(&self, element: u32) -> &Quadric {
        &self.quadric_tests[element as usize]
    }

    pub fn memory_bytes(&self) -> usize {
        self.triangles.memory_bytes()
            + self.quadrics.memory_bytes()
            + size_of_val(&*self.packets)
            + size_of_val(&*self.packet_ids)
            + size_of_val(&*self.quadric_tests)
    }
}

fn is_usable(bounds: &Aabb) -> bool {
    bounds.valid() && bounds.min.abs().max(bounds.max.abs()).max_element() <= LARGEST_COORDINATE
}

/// Searches an object along a ray in its space; `instance` is what hits are labelled with.
#[inline(always)]
pub fn search(
    object: &ObjectAccel,
    instance: u32,
    ray: &mut TraversalRay,
    query: &mut Query,
    stack: &mut Stack,
    kernels: impl Kernels,
) {
    let enter = |node: &Node, ray: &TraversalRay| kernels.enter(node, ray);
    let triangles = &mut TriangleLeaves { object, instance, query, kernels };
    traverse(&object.triangles, ray, stack, enter, triangles);
    if !(query.any && query.hit.is_some()) {
        traverse(&object.quadrics, ray, stack, enter, &mut QuadricLeaves { object, instance, query });
    }
}

struct TriangleLeaves<'a, 'q, K> {
    object: &'a ObjectAccel,
    instance: u32,
    query: &'a mut Query<'q>,
    kernels: K,
}

impl<K: Kernels> Leaves for TriangleLeaves<'_, '_, K> {
    #[inline(always)]
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.object.packets, leaf);
        prefetch(&self.object.packet_ids, leaf);
    }

    #[inline(always)]
    fn test(&mut self, leaf: u32, ray: &mut TraversalRay, _: &mut Stack) -> bool {
        let packet = &self.object.packets[leaf as usize];
        let Some(candidates) = self.kernels.candidates(packet, ray) else { return false };
        let mut mask = candidates.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % WIDTH;
            mask &= mask - 1;
            let found = if candidates.sure >> lane & 1 == 1 {
                Some(candidates.hit(lane)).filter(|found| found.t < ray.t_max)
            } else {
                packet.hit(ray, lane)
            };
            let Some(found) = found else { continue };
            let id = self.object.packet_ids[leaf as usize].0[lane];
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
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.object.quadric_tests, leaf);
    }

    #[inline(always)]
    fn test(&mut self, leaf: u32, ray: &mut TraversalRay, _: &mut Stack) -> bool {
        let quadric = &self.object.quadric_tests[leaf as usize];
        for t in quadric.distances(ray) {
            // NaN is no hit.
            if t > 0.0 && t < ray.t_max {
                let hit = Hit {
                    t,
                    primitive: quadric.primitive,
                    element: leaf,
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
