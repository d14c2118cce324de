//! Traverses an eight-wide hierarchy along a ray, nearest boxes first.
//!
//! Everything here is inlined into functions compiled for several instruction sets; loops over
//! [`WIDTH`] lanes become vector instructions. No operation is fused, so that all of them give the
//! same bits.

use super::bvh::{Bvh, LEAF, Node, WIDTH};
use super::kernels::BoxHits;
use super::stack::{Stack, StackEntry};
use super::traversal_ray::TraversalRay;
use crate::simd::prefetch;

/// Intersects the leaves of a hierarchy.
pub trait Leaves {
    /// Intersects a leaf and lowers `ray.t_max` to the nearest hit; returns whether the traversal
    /// can end. `stack` is as high afterwards as before.
    fn intersect(&mut self, leaf: u32, ray: &mut TraversalRay, stack: &mut Stack) -> bool;

    /// Starts loading a leaf that will be intersected soon into the cache.
    fn prefetch(&self, leaf: usize);
}

/// Intersects every leaf whose box the ray enters before its `t_max`, roughly from near to far.
/// `intersect_boxes` is the slab test for the instruction set at hand.
#[inline(always)]
pub fn traverse(
    bvh: &Bvh,
    ray: &mut TraversalRay,
    stack: &mut Stack,
    intersect_boxes: impl Fn(&Node, &TraversalRay) -> BoxHits,
    leaves: &mut impl Leaves,
) {
    if bvh.nodes.is_empty() {
        return;
    }
    let bottom = stack.height();
    let mut current = 0;
    loop {
        let child = if current & LEAF == 0 {
            let node = &bvh.nodes[current as usize];
            let prefetch = |child| {
                if child & LEAF == 0 {
                    prefetch(&bvh.nodes, child as usize)
                } else {
                    leaves.prefetch((child & !LEAF) as usize)
                }
            };
            descend(node, intersect_boxes(node, ray), stack, prefetch)
        } else if leaves.intersect(current & !LEAF, ray, stack) {
            stack.drop_above(bottom);
            return;
        } else {
            None
        };
        let Some(next) = child.or_else(|| stack.pop_before(ray.t_max, bottom)) else { return };
        current = next;
    }
}

/// Pushes the children that the ray enters onto the stack, nearer ones above, but for the nearest,
/// which is returned.
#[inline(always)]
fn descend(node: &Node, hits: BoxHits, stack: &mut Stack, prefetch: impl Fn(u32)) -> Option<u32> {
    let entry = |mask: u32| {
        let lane = mask.trailing_zeros() as usize % WIDTH;
        prefetch(node.children[lane]);
        StackEntry::new(hits.t_near[lane], node.children[lane])
    };
    let without_lowest = |mask: u32| mask & mask.wrapping_sub(1);

    // Return early for up to one child, by far the most frequent case together with two
    if hits.mask == 0 {
        return None;
    }
    let first = entry(hits.mask);
    let mut mask = without_lowest(hits.mask);
    if mask == 0 {
        return Some(first.child());
    }

    // Sort the children by descending distance
    let second = entry(mask);
    mask = without_lowest(mask);
    let mut sorted = [StackEntry::ZERO; WIDTH];
    (sorted[0], sorted[1]) = if first < second { (second, first) } else { (first, second) };
    let mut count = 2;
    while mask != 0 {
        let next = entry(mask);
        mask = without_lowest(mask);
        let mut slot = count;
        while slot > 0 && sorted[slot - 1] < next {
            sorted[slot % WIDTH] = sorted[slot - 1];
            slot -= 1;
        }
        sorted[slot % WIDTH] = next;
        count += 1;
    }

    // Push all but the nearest
    for &entry in &sorted[..count - 1] {
        stack.push(entry);
    }
    Some(sorted[count - 1].child())
}
