//! The acceleration structure of one object (bottom level): a hierarchy of its triangles, and one of
//! its spheres and disks.

use glam::{Vec2, Vec3, Vec3A};
use obvhs::aabb::Aabb;

use super::bvh::{Bvh, NO_ITEM, Node, WIDTH};
use super::kernels::Kernels;
use super::quadric::Quadric;
use super::ray_query::RayQuery;
use super::rounding::gamma;
use super::stack::Stack;
use super::traversal_ray::TraversalRay;
use super::traverse::{Leaves, traverse};
use super::triangle::TrianglePacket;
use super::{Hit, mesh};
use crate::scene::shape::LARGEST_COORDINATE;
use crate::scene::{Object, Scene, Shape, TriangleMesh};
use crate::simd::prefetch;

/// A triangle of a primitive.
#[derive(Clone, Copy, Debug)]
struct TriangleId {
    primitive: u32,
    triangle: u32,
}

/// The triangles of a packet, in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct PacketIds([TriangleId; WIDTH]);

/// The acceleration structure of an object, in the object's space.
#[derive(Debug)]
pub struct ObjectAccel {
    triangle_bvh: Bvh,
    /// One for each leaf of `triangle_bvh`.
    packets: Vec<TrianglePacket>,
    /// One for each of `packets`.
    packet_ids: Vec<PacketIds>,
    quadric_bvh: Bvh,
    /// One for each leaf of `quadric_bvh`.
    quadrics: Vec<Quadric>,
}

/// Items of a hierarchy, and their boxes.
struct BoxedItems<T> {
    items: Vec<T>,
    boxes: Vec<Aabb>,
}

impl<T> Default for BoxedItems<T> {
    fn default() -> Self {
        Self { items: Vec::new(), boxes: Vec::new() }
    }
}

impl<T> BoxedItems<T> {
    fn push(&mut self, item: T, bounds: Aabb) {
        self.items.push(item);
        self.boxes.push(bounds);
    }
}

impl ObjectAccel {
    /// Builds the hierarchies of one object. Triangles without area, shapes that are not finite, and
    /// coordinates beyond [`LARGEST_COORDINATE`] are left out.
    pub fn build(scene: &Scene, object: &Object) -> Self {
        let mut triangles = BoxedItems::default();
        let mut quadrics = BoxedItems::default();
        for primitive in object.primitives.clone().filter(|&index| index < scene.primitives.len()) {
            let index = primitive as u32;
            let shape = &scene.primitives[primitive].shape;
            if let Some((quadric, bounds)) =
                Quadric::new(index, shape).filter(|(_, bounds)| is_usable(bounds))
            {
                quadrics.push(quadric, bounds);
            }
            if let Shape::Mesh(mesh) = shape {
                push_triangles(mesh, index, &mut triangles);
            }
        }

        let triangle_bvh = Bvh::build(&triangles.boxes, WIDTH);
        let (packets, packet_ids) = triangle_packets(scene, &triangle_bvh, &triangles.items);
        let quadric_bvh = Bvh::build(&quadrics.boxes, 1);
        let leaf_quadrics = quadric_bvh.slots.iter().map(|&item| quadrics.items[item as usize]).collect();
        Self { triangle_bvh, packets, packet_ids, quadric_bvh, quadrics: leaf_quadrics }
    }

    /// The box around all shapes, or `None` if there are none.
    pub fn bounds(&self) -> Option<Aabb> {
        let both = self.triangle_bvh.bounds.union(&self.quadric_bvh.bounds);
        both.valid().then_some(both)
    }

    /// Corners, primitive, and index in its mesh of each triangle.
    pub fn triangles(&self) -> impl Iterator<Item = ([Vec3; 3], u32, u32)> {
        let ids = self.packet_ids.iter().flat_map(|ids| &ids.0).enumerate();
        let ids = ids.filter(|(_, id)| id.primitive != NO_ITEM);
        ids.map(|(slot, id)| {
            let corners = self.packets[slot / WIDTH].corners;
            let corners = corners.map(|planes| Vec3::from_array(planes.map(|plane| plane[slot % WIDTH])));
            (corners, id.primitive, id.triangle)
        })
    }

    /// Spheres and disks, indexed by [`Hit::element`].
    pub fn quadrics(&self) -> &[Quadric] {
        &self.quadrics
    }

    /// The sphere or disk with this [`Hit::element`].
    #[inline]
    pub fn quadric(&self, element: u32) -> &Quadric {
        &self.quadrics[element as usize]
    }

    /// Memory of the structure in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.triangle_bvh.memory_bytes()
            + self.quadric_bvh.memory_bytes()
            + size_of_val(&*self.packets)
            + size_of_val(&*self.packet_ids)
            + size_of_val(&*self.quadrics)
    }
}

/// Adds the triangles of a mesh that have an area and usable coordinates.
fn push_triangles(mesh: &TriangleMesh, primitive: u32, triangles: &mut BoxedItems<TriangleId>) {
    for triangle in 0..mesh.indices.len() as u32 {
        let corners = mesh::corners(mesh, triangle);
        let bounds = Aabb::from_points(&corners.map(Vec3A::from));
        let finite = corners.iter().all(|corner| corner.is_finite());
        if finite && is_usable(&bounds) && mesh::scaled_normal(corners).length_squared() > 0.0 {
            triangles.push(TriangleId { primitive, triangle }, widened(bounds));
        }
    }
}

/// Widens the box of a triangle by the rounding of its test, which grows with the distance of its corners from the hit: near an edge of
/// two long triangles a ray may otherwise hit the one and enter the box of the other (Woop, Benthin and Wald 2013, section 4). Boxes stay flat where
/// they are: there all rays meet the triangle where they meet the box.
fn widened(bounds: Aabb) -> Aabb {
    let extent = bounds.max - bounds.min;
    let pad = gamma(8) * extent.max_element();
    let is_flat = extent.cmpeq(Vec3A::ZERO);
    let outward = |bound: Vec3A, pad: f32, next: fn(f32) -> f32| {
        let moved = bound + pad;
        Vec3A::select(is_flat, bound, Vec3A::from(moved.to_array().map(next)))
    };
    let [min, max] = [outward(bounds.min, -pad, f32::next_down), outward(bounds.max, pad, f32::next_up)];
    Aabb { min, max }
}

/// A packet for each leaf of the hierarchy, and the triangles in it.
fn triangle_packets(scene: &Scene, bvh: &Bvh, ids: &[TriangleId]) -> (Vec<TrianglePacket>, Vec<PacketIds>) {
    let unused = PacketIds([TriangleId { primitive: NO_ITEM, triangle: NO_ITEM }; WIDTH]);
    let mut packets = vec![TrianglePacket::EMPTY; bvh.slots.len() / WIDTH];
    let mut packet_ids = vec![unused; packets.len()];
    for (slot, &item) in bvh.slots.iter().enumerate().filter(|&(_, &item)| item != NO_ITEM) {
        let id = ids[item as usize];
        packet_ids[slot / WIDTH].0[slot % WIDTH] = id;
        if let Shape::Mesh(mesh) = &scene.primitives[id.primitive as usize].shape {
            packets[slot / WIDTH].set(slot % WIDTH, mesh::corners(mesh, id.triangle));
        }
    }
    (packets, packet_ids)
}

/// Whether a box is valid, with coordinates of at most [`LARGEST_COORDINATE`].
fn is_usable(bounds: &Aabb) -> bool {
    bounds.valid() && bounds.min.abs().max(bounds.max.abs()).max_element() <= LARGEST_COORDINATE
}

/// Searches an object along a ray in the object's space. Hits are given the index `instance`.
#[inline(always)]
pub fn search_object(
    object: &ObjectAccel,
    instance: u32,
    ray: &mut TraversalRay,
    query: &mut RayQuery,
    stack: &mut Stack,
    kernels: impl Kernels,
) {
    let intersect_boxes = |node: &Node, ray: &TraversalRay| kernels.intersect_boxes(node, ray);
    let triangles = &mut TriangleLeaves { object, instance, query, kernels };
    traverse(&object.triangle_bvh, ray, stack, intersect_boxes, triangles);
    if !query.is_settled() {
        let quadrics = &mut QuadricLeaves { object, instance, query };
        traverse(&object.quadric_bvh, ray, stack, intersect_boxes, quadrics);
    }
}

struct TriangleLeaves<'a, 'q, K> {
    object: &'a ObjectAccel,
    instance: u32,
    query: &'a mut RayQuery<'q>,
    kernels: K,
}

impl<K: Kernels> Leaves for TriangleLeaves<'_, '_, K> {
    #[inline(always)]
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.object.packets, leaf);
        prefetch(&self.object.packet_ids, leaf);
    }

    #[inline(always)]
    fn intersect(&mut self, leaf: u32, ray: &mut TraversalRay, _: &mut Stack) -> bool {
        let packet = &self.object.packets[leaf as usize];
        let Some(candidates) = self.kernels.intersect_triangles(packet, ray) else { return false };
        let mut mask = candidates.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % WIDTH;
            mask &= mask - 1;
            let found = if candidates.certain >> lane & 1 == 1 {
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
                if self.query.any_hit {
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
    query: &'a mut RayQuery<'q>,
}

impl Leaves for QuadricLeaves<'_, '_> {
    #[inline(always)]
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.object.quadrics, leaf);
    }

    #[inline(always)]
    fn intersect(&mut self, leaf: u32, ray: &mut TraversalRay, _: &mut Stack) -> bool {
        let quadric = &self.object.quadrics[leaf as usize];
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
        self.query.is_settled()
    }
}
