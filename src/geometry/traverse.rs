//! Walks a ray through an eight-wide hierarchy, nearest boxes first.
//!
//! Everything here is inlined into functions compiled for several instruction sets; loops over
//! [`WIDTH`] lanes become vector instructions. No operation is fused, so that all of them give the
//! same bits.

use glam::{DAffine3, Vec3};

use super::bvh::{Bvh, LEAF, Node, WIDTH};
use super::kernels::Entered;

/// Entries of the stack before it spills to the heap; enough for any but degenerate scenes.
const STACK_SIZE: usize = 64;

/// For each major axis, and for directions along and against it: the other two in the order that
/// keeps the handedness, and itself.
const AXES: [[[usize; 3]; 2]; 3] = [[[1, 2, 0], [2, 1, 0]], [[2, 0, 1], [0, 2, 1]], [[0, 1, 2], [1, 0, 2]]];

/// A ray, prepared for boxes and triangles.
#[derive(Clone, Copy, Debug)]
pub struct TraversalRay {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Reciprocals of the direction's components.
    pub inverse: Vec3,
    /// Distance of the nearest hit so far.
    pub t_max: f32,
    /// For each axis 0 if the ray meets a box's minimum first, otherwise 1.
    pub backward: [usize; 3],
    /// Axes permuted so that the last is the one of the largest direction component, and the
    /// handedness is kept (Woop, Benthin and Wald 2013, section 3.1).
    pub axes: [usize; 3],
    /// The origin's coordinates in the order of `axes`.
    pub permuted_origin: [f32; 3],
    /// Shear that takes the direction to the last axis.
    pub shear: [f32; 2],
    /// Distance for a unit along the last axis.
    pub scale: f32,
}

impl TraversalRay {
    /// `None` for rays that can hit nothing: not finite, or without a direction.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Option<Self> {
        let size = direction.abs();
        let major = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        // Zero times what is not finite is not a number.
        let finite = (0.0 * origin + 0.0 * direction).element_sum() == 0.0;
        if !(finite && t_max > 0.0 && size[major] > 0.0) {
            return None;
        }
        let inverse = direction.recip();
        let scale = inverse[major];
        let axes @ [a, b, _] = AXES[major][(scale < 0.0) as usize];
        Some(Self {
            origin,
            direction,
            inverse,
            t_max,
            backward: inverse.to_array().map(|x| (x.to_bits() >> 31) as usize),
            axes,
            permuted_origin: axes.map(|axis| origin[axis]),
            shear: [direction[a] * scale, direction[b] * scale],
            scale,
        })
    }

    /// The same ray in another space. The direction is not normalised, so distances are the same.
    #[inline]
    pub fn transformed(&self, to_local: &DAffine3) -> Option<Self> {
        Self::new(
            to_local.transform_point3(self.origin.as_dvec3()).as_vec3(),
            to_local.transform_vector3(self.direction.as_dvec3()).as_vec3(),
            self.t_max,
        )
    }
}

/// What the leaves of a hierarchy hold.
pub trait Leaves {
    /// Tests a leaf, lowers `ray.t_max` to what it finds; `true` ends the walk. What is put on the
    /// stack is taken away again.
    fn test(&mut self, leaf: u32, ray: &mut TraversalRay, stack: &mut Stack) -> bool;

    /// Has a leaf that will be tested soon brought into the cache.
    fn prefetch(&self, leaf: usize);
}

/// Has one of some items brought into the cache.
#[inline(always)]
pub fn prefetch<T>(items: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        /// Bytes.
        const CACHE_LINE: usize = 64;
        let item = items.as_ptr().wrapping_add(index).cast::<i8>();
        for offset in (0..size_of::<T>()).step_by(CACHE_LINE) {
            // SAFETY: a hint that every such processor takes, and that no address makes fail.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(item.wrapping_add(offset)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, index);
}

/// Calls `leaves` for every leaf whose box the ray enters before its `t_max`, roughly in order.
/// `enter` is the slab test for the instruction set at hand.
#[inline(always)]
pub fn traverse(
    bvh: &Bvh,
    ray: &mut TraversalRay,
    stack: &mut Stack,
    enter: impl Fn(&Node, &TraversalRay) -> Entered,
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
            descend(node, enter(node, ray), stack, prefetch)
        } else if leaves.test(current & !LEAF, ray, stack) {
            stack.drop_above(bottom);
            return;
        } else {
            None
        };
        let Some(next) = child.or_else(|| stack.pop_before(ray.t_max, bottom)) else { return };
        current = next;
    }
}

/// The nearest child that was entered; the others are left on the stack, nearer ones above.
#[inline(always)]
fn descend(node: &Node, entered: Entered, stack: &mut Stack, prefetch: impl Fn(u32)) -> Option<u32> {
    let visit = |mask: u32| {
        let lane = mask.trailing_zeros() as usize % WIDTH;
        prefetch(node.children[lane]);
        Visit::new(entered.near[lane], node.children[lane])
    };
    let without_lowest = |mask: u32| mask & mask.wrapping_sub(1);
    if entered.mask == 0 {
        return None;
    }
    // One or two children are by far the most frequent.
    let first = visit(entered.mask);
    let mut mask = without_lowest(entered.mask);
    if mask == 0 {
        return Some(first.child());
    }
    let second = visit(mask);
    mask = without_lowest(mask);
    let mut sorted = [Visit(0); WIDTH];
    (sorted[0], sorted[1]) = if first < second { (second, first) } else { (first, second) };
    let mut count = 2;
    while mask != 0 {
        let next = visit(mask);
        mask = without_lowest(mask);
        let mut place = count;
        while place > 0 && sorted[place - 1] < next {
            sorted[place % WIDTH] = sorted[place - 1];
            place -= 1;
        }
        sorted[place % WIDTH] = next;
        count += 1;
    }
    for &visit in &sorted[..count - 1] {
        stack.push(visit);
    }
    Some(sorted[count - 1].child())
}

/// A node to visit: entry distance above, child reference below, ordered by distance. The bits of
/// floats that are not negative are ordered as the floats are.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Visit(u64);

impl Visit {
    #[inline(always)]
    fn new(entry: f32, child: u32) -> Self {
        Self((entry.to_bits() as u64) << 32 | child as u64)
    }

    #[inline(always)]
    fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn child(self) -> u32 {
        self.0 as u32
    }
}

/// What is still to be visited, by one walk above the other. Made once for many rays.
pub struct Stack {
    visits: [Visit; STACK_SIZE],
    len: usize,
    spilled: Vec<Visit>,
}

impl Stack {
    #[inline]
    pub fn new() -> Self {
        Self { visits: [Visit(0); STACK_SIZE], len: 0, spilled: Vec::new() }
    }

    #[inline(always)]
    fn height(&self) -> usize {
        self.len + self.spilled.len()
    }

    #[inline(always)]
    fn push(&mut self, visit: Visit) {
        if self.len < STACK_SIZE {
            self.visits[self.len] = visit;
            self.len += 1;
        } else {
            self.spilled.push(visit);
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Visit {
        self.spilled.pop().unwrap_or_else(|| {
            self.len -= 1;
            self.visits[self.len % STACK_SIZE]
        })
    }

    /// The child on top among those above `bottom` and entered before `t_max`; what lies above it
    /// is dropped.
    #[inline(always)]
    fn pop_before(&mut self, t_max: f32, bottom: usize) -> Option<u32> {
        while self.height() > bottom {
            let visit = self.pop();
            if visit.entry() <= t_max {
                return Some(visit.child());
            }
        }
        None
    }

    fn drop_above(&mut self, bottom: usize) {
        while self.height() > bottom {
            self.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stack_gives_back_all_that_it_takes_beyond_its_size() {
        let mut stack = Stack::new();
        stack.push(Visit::new(0.0, 7));
        let bottom = stack.height();
        let count = 3 * STACK_SIZE as u32;
        for child in 0..count {
            stack.push(Visit::new(child as f32, child));
        }
        // Those entered farther than half of all are skipped, and what another walk left stays.
        let popped: Vec<_> = std::iter::from_fn(|| stack.pop_before((count / 2) as f32, bottom)).collect();
        assert_eq!(popped, (0..=count / 2).rev().collect::<Vec<_>>());
        assert_eq!(stack.pop().child(), 7);
    }
}
