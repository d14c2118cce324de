//! The top level of the acceleration structure: a hierarchy of instances, with the boxes of moving
//! ones over the shutter interval.

use glam::{DAffine3, DMat3, DVec3};
use obvhs::aabb::Aabb;

use super::bvh::{Bvh, Node, rounded_out};
use super::kernels::Kernels;
use super::object::{ObjectAccel, search_object};
use super::ray_query::RayQuery;
use super::rounding::gamma;
use super::sphere::corner_bounds;
use super::stack::Stack;
use super::traversal_ray::{ToLocal, TraversalRay};
use super::traverse::{Leaves, traverse};
use crate::scene::{AnimatedTransform, Scene};
use crate::simd::prefetch;

/// Number of time intervals into which the path of a moving instance is divided. Between the ends of
/// an interval its deviation from a chord is bounded; over half a turn by 0.02 % of its size.
const MOTION_STEPS: u32 = 128;

/// The transform of an instance from render to object space.
#[derive(Debug)]
enum ToObject {
    Static(ToLocal),
    /// The transform depends on time; index into the scene's instances.
    Animated(usize),
}

#[derive(Debug)]
struct InstanceLeaf {
    object: usize,
    instance: u32,
    to_object: ToObject,
}

/// The hierarchy of all instances.
#[derive(Debug)]
pub struct InstanceAccel {
    bvh: Bvh,
    /// One for each leaf of `bvh`.
    leaves: Vec<InstanceLeaf>,
}

impl InstanceAccel {
    /// Builds the hierarchy. `objects` has one entry for each of the scene's objects; instances of
    /// empty objects are left out.
    pub fn build(scene: &Scene, objects: &[ObjectAccel]) -> Self {
        let shutter = (scene.camera.shutter_open, scene.camera.shutter_close);
        let mut boxes = Vec::new();
        let mut items = Vec::new();
        for (index, instance) in scene.instances.iter().enumerate() {
            let bounds = objects.get(instance.object).and_then(ObjectAccel::bounds);
            let Some(swept) = bounds.and_then(|bounds| swept_bounds(&instance.transform, &bounds, shutter))
            else {
                continue;
            };
            boxes.push(swept);
            items.push(index);
        }
        let bvh = Bvh::build(&boxes, 1);
        let leaf = |&item: &u32| {
            let index = items[item as usize];
            let instance = &scene.instances[index];
            let to_object = if instance.transform.is_animated() {
                ToObject::Animated(index)
            } else {
                ToObject::Static(instance.transform.at_f64(0.0).inverse().into())
            };
            InstanceLeaf { object: instance.object, instance: index as u32, to_object }
        };
        let leaves = bvh.slots.iter().map(leaf).collect();
        Self { bvh, leaves }
    }

    pub fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }

    /// The box around all instances; invalid if there are none.
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds
    }

    /// Memory of the structure in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.bvh.memory_bytes() + size_of_val(&*self.leaves)
    }
}

/// An instance's transform to render space at a time, and its inverse.
pub fn transforms_at(transform: &AnimatedTransform, time: f32) -> (DAffine3, DAffine3) {
    let to_render = transform.at_f64(time);
    (to_render, to_render.inverse())
}

/// Searches all instances along a ray in render space.
#[inline(always)]
pub fn search_instances(
    instances: &InstanceAccel,
    objects: &[ObjectAccel],
    ray: &mut TraversalRay,
    query: &mut RayQuery,
    stack: &mut Stack,
    kernels: impl Kernels,
) {
    let intersect_boxes = |node: &Node, ray: &TraversalRay| kernels.intersect_boxes(node, ray);
    let leaves = &mut InstanceLeaves { instances, objects, query, kernels };
    traverse(&instances.bvh, ray, stack, intersect_boxes, leaves);
}

struct InstanceLeaves<'a, 'q, K> {
    instances: &'a InstanceAccel,
    objects: &'a [ObjectAccel],
    query: &'a mut RayQuery<'q>,
    kernels: K,
}

impl<K: Kernels> Leaves for InstanceLeaves<'_, '_, K> {
    #[inline(always)]
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.instances.leaves, leaf);
    }

    #[inline(always)]
    fn intersect(&mut self, leaf: u32, ray: &mut TraversalRay, stack: &mut Stack) -> bool {
        let leaf = &self.instances.leaves[leaf as usize];
        let to_object = match leaf.to_object {
            ToObject::Static(to_object) => to_object,
            ToObject::Animated(index) => {
                transforms_at(&self.query.scene.instances[index].transform, self.query.ray.time).1.into()
            }
        };
        if let Some(mut local_ray) = ray.transformed(&to_object) {
            let object = &self.objects[leaf.object];
            search_object(object, leaf.instance, &mut local_ray, self.query, stack, self.kernels);
            ray.t_max = local_ray.t_max;
        }
        self.query.is_settled()
    }
}

/// A box that holds the transformed `bounds` at all times of the `shutter` interval; `None` if it is
/// not finite.
fn swept_bounds(transform: &AnimatedTransform, bounds: &Aabb, shutter: (f32, f32)) -> Option<Aabb> {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let farthest = min.abs().max(max.abs());
    let mut swept = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut rounding = DVec3::ZERO;
    let mut add = |to_render: &DAffine3| {
        let (low, high) = corner_bounds(to_render, min, max);
        swept = (swept.0.min(low), swept.1.max(high));
        // The origins of rays are rounded in object space.
        let linear = to_render.matrix3;
        let absolute = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
        rounding = rounding.max(gamma(8) as f64 * (absolute * farthest + to_render.translation.abs()));
    };
    let (open, close) = shutter;
    add(&transform.at_f64(open));
    let mut padding = 0.0;
    if transform.moves_during(open, close) {
        add(&transform.at_f64(close));
        // The path is smooth between its keys only.
        let [first, last] = [open, close].map(|time| time.max(transform.start_time).min(transform.end_time));
        let time_step = (last - first) / MOTION_STEPS as f32;
        for step in 0..=MOTION_STEPS {
            add(&transform.at_f64(first + step as f32 * time_step));
        }
        // The path deviates from a chord over time h by at most h²/8 times its second derivative.
        // Keys at the same time give NaN, which `max` replaces by 0.
        let chord = ((time_step / (transform.end_time - transform.start_time)) as f64).max(0.0);
        padding = chord * chord / 8.0 * transform.acceleration_bound(farthest.length());
    }
    rounded_out(swept.0 - rounding - padding, swept.1 + rounding + padding)
}
