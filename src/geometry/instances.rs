//! The upper level: instances of objects, and the boxes of those that move.

use glam::{DAffine3, DMat3, DVec3};
use obvhs::aabb::Aabb;

use super::bvh::{Bvh, Node, rounded_out};
use super::kernels::Kernels;
use super::object::{ObjectAccel, search};
use super::query::Query;
use super::rounding::gamma;
use super::sphere::corner_bounds;
use super::traverse::{Leaves, Stack, TraversalRay, prefetch, traverse};
use crate::scene::{AnimatedTransform, Scene};

/// Intervals between the times at which the path of a moving instance is evaluated. What it may do
/// in between is bounded: for half a turn by 0.02 % of its size.
const MOTION_STEPS: u32 = 128;

/// Where an instance is.
#[derive(Debug)]
enum Placement {
    /// Render to object space.
    Fixed(DAffine3),
    /// Index into the scene's instances.
    Moving(usize),
}

#[derive(Debug)]
struct Placed {
    object: usize,
    instance: u32,
    placement: Placement,
}

/// All instances.
#[derive(Debug)]
pub struct InstanceAccel {
    bvh: Bvh,
    /// One for each leaf.
    placed: Vec<Placed>,
}

impl InstanceAccel {
    /// `objects` are indexed as the scene's.
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
        let place = |&item: &u32| {
            let index = items[item as usize];
            let instance = &scene.instances[index];
            let placement = if instance.transform.is_animated() {
                Placement::Moving(index)
            } else {
                Placement::Fixed(instance.transform.at_f64(0.0).inverse())
            };
            Placed { object: instance.object, instance: index as u32, placement }
        };
        let placed = bvh.slots.iter().map(place).collect();
        Self { bvh, placed }
    }

    pub fn is_empty(&self) -> bool {
        self.placed.is_empty()
    }

    /// Invalid if there are no instances.
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds
    }

    pub fn memory_bytes(&self) -> usize {
        self.bvh.memory_bytes() + size_of_val(&*self.placed)
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
    query: &mut Query,
    stack: &mut Stack,
    kernels: impl Kernels,
) {
    let enter = |node: &Node, ray: &TraversalRay| kernels.enter(node, ray);
    traverse(&instances.bvh, ray, stack, enter, &mut InstanceLeaves { instances, objects, query, kernels });
}

struct InstanceLeaves<'a, 'q, K> {
    instances: &'a InstanceAccel,
    objects: &'a [ObjectAccel],
    query: &'a mut Query<'q>,
    kernels: K,
}

impl<K: Kernels> Leaves for InstanceLeaves<'_, '_, K> {
    #[inline(always)]
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.instances.placed, leaf);
    }

    #[inline(always)]
    fn test(&mut self, leaf: u32, ray: &mut TraversalRay, stack: &mut Stack) -> bool {
        let placed = &self.instances.placed[leaf as usize];
        let to_object = match placed.placement {
            Placement::Fixed(to_object) => to_object,
            Placement::Moving(index) => {
                transforms_at(&self.query.scene.instances[index].transform, self.query.ray.time).1
            }
        };
        if let Some(mut local) = ray.transformed(&to_object) {
            let object = &self.objects[placed.object];
            search(object, placed.instance, &mut local, self.query, stack, self.kernels);
            ray.t_max = local.t_max;
        }
        self.query.any && self.query.hit.is_some()
    }
}

/// A box around everything that a transformed box touches while the shutter is open; `None` if it
/// is not finite.
fn swept_bounds(transform: &AnimatedTransform, bounds: &Aabb, shutter: (f32, f32)) -> Option<Aabb> {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let farthest = min.abs().max(max.abs());
    let mut swept = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut rounding = DVec3::ZERO;
    let mut add = |placed: &DAffine3| {
        let (low, high) = corner_bounds(placed, min, max);
        swept = (swept.0.min(low), swept.1.max(high));
        // Rays are moved to object space through rounded origins.
        let linear = placed.matrix3;
        let absolute = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
        rounding = rounding.max(gamma(8) as f64 * (absolute * farthest + placed.translation.abs()));
    };
    let (open, close) = shutter;
    add(&transform.at_f64(open));
    let mut padding = 0.0;
    if transform.moves_during(open, close) {
        add(&transform.at_f64(close));
        // Only between the keys is the path smooth.
        let [first, last] = [open, close].map(|time| time.max(transform.start_time).min(transform.end_time));
        let time_step = (last - first) / MOTION_STEPS as f32;
        for step in 0..=MOTION_STEPS {
            add(&transform.at_f64(first + step as f32 * time_step));
        }
        // A chord of length h is missed by at most h²/8 times the second derivative.
        // (Keys at the same time give NaN, and no length.)
        let chord = ((time_step / (transform.end_time - transform.start_time)) as f64).max(0.0);
        padding = chord * chord / 8.0 * transform.acceleration_bound(farthest.length());
    }
    rounded_out(swept.0 - rounding - padding, swept.1 + rounding + padding)
}
