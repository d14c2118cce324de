//! Builds an eight-wide bounding volume hierarchy over boxes.
//!
//! The obvhs crate builds a binary hierarchy (PLOC with reinsertion; Meister and Bittner 2018). It is
//! collapsed to eight children per node, whose boxes one vector instruction can test (Wald, Benthin
//! and Boulos 2008).

use glam::Vec3A;
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};
use std::time::Duration;

/// Children of a node; also the largest number of items in a leaf.
pub const WIDTH: usize = 8;

/// Bit that marks a child as a leaf; the other bits are then the leaf's index.
pub const LEAF: u32 = 1 << 31;

/// An unused slot of a leaf.
pub const NO_ITEM: u32 = u32::MAX;

/// Eight children. Unused ones have an inverted box, which no ray enters.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Node {
    /// Bounds of the children's boxes: `planes[axis][0]` minima, `planes[axis][1]` maxima.
    pub planes: [[[f32; WIDTH]; 2]; 3],
    /// Index of a node, or [`LEAF`] with the index of a leaf.
    pub children: [u32; WIDTH],
}

impl Node {
    const EMPTY: Self = {
        let inverted = [[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]];
        Self { planes: [inverted; 3], children: [LEAF; WIDTH] }
    };

    fn child_box(&self, child: usize) -> Aabb {
        let corner = |side: usize| Vec3A::from_array(self.planes.map(|axis| axis[side][child]));
        Aabb::new(corner(0), corner(1))
    }

    fn set_box(&mut self, child: usize, bounds: &Aabb) {
        for (axis, [low, high]) in self.planes.iter_mut().enumerate() {
            low[child] = bounds.min[axis];
            high[child] = bounds.max[axis];
        }
    }
}

/// A hierarchy over items that are given by their boxes and known by their index.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// The first node is the root; empty if there are no items.
    pub nodes: Vec<Node>,
    /// Items of the leaves, `leaf_width` slots each: item indices, then [`NO_ITEM`].
    pub slots: Vec<u32>,
    pub bounds: Aabb,
}

impl Bvh {
    /// Builds a hierarchy over finite boxes, with at most `leaf_width` items in a leaf.
    pub fn build(boxes: &[Aabb], leaf_width: usize) -> Self {
        // The collapse decides which subtrees become leaves.
        let settings = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let binary = build_bvh2(boxes, settings, &mut Duration::default());
        let mut wide = Self { nodes: Vec::new(), slots: Vec::new(), bounds: Aabb::INVALID };
        if boxes.is_empty() {
            return wide;
        }
        wide.bounds = *binary.nodes[0].aabb();
        Collapse { counts: item_counts(&binary), binary: &binary, leaf_width }.build(&mut wide);
        if cfg!(debug_assertions) {
            wide.validate(boxes, leaf_width);
        }
        wide
    }

    /// Checks the invariants: each item is in exactly one leaf, and the box of a child holds the boxes
    /// of everything below it.
    ///
    /// # Panics
    /// If an invariant does not hold.
    fn validate(&self, boxes: &[Aabb], leaf_width: usize) {
        let mut found = vec![0; boxes.len()];
        let mut pending = vec![(0, self.bounds)];
        while let Some((index, parent)) = pending.pop() {
            let node: &Node = &self.nodes[index];
            for (slot, bounds) in (0..WIDTH).map(|slot| (slot, node.child_box(slot))) {
                if !bounds.valid() {
                    continue;
                }
                assert!(holds(&parent, &bounds), "child {slot} of node {index} is inside its parent");
                let child = node.children[slot];
                if child & LEAF == 0 {
                    pending.push((child as usize, bounds));
                    continue;
                }
                let items = &self.slots[(child & !LEAF) as usize * leaf_width..][..leaf_width];
                for &item in items.iter().take_while(|&&item| item != NO_ITEM) {
                    assert!(holds(&bounds, &boxes[item as usize]), "item {item} is inside its leaf");
                    found[item as usize] += 1;
                }
            }
        }
        assert!(found.iter().all(|&count| count == 1), "every item is in exactly one leaf");
    }

    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.slots)
    }
}

/// Number of items in the subtree of each node.
fn item_counts(binary: &Bvh2) -> Vec<u32> {
    let mut counts = vec![0; binary.nodes.len()];
    let mut order = vec![0];
    let mut next = 0;
    while next < order.len() {
        let node = &binary.nodes[order[next]];
        if !node.is_leaf() {
            order.extend([node.first_index as usize, node.first_index as usize + 1]);
        }
        next += 1;
    }
    for &index in order.iter().rev() {
        let node = &binary.nodes[index];
        let first = node.first_index as usize;
        counts[index] = if node.is_leaf() { node.prim_count } else { counts[first] + counts[first + 1] };
    }
    counts
}

/// The conversion of a binary hierarchy to a wide one.
struct Collapse<'b> {
    binary: &'b Bvh2,
    counts: Vec<u32>,
    leaf_width: usize,
}

impl Collapse<'_> {
    fn build(&self, wide: &mut Bvh) {
        wide.nodes.push(Node::EMPTY);
        let mut pending = vec![(0, 0)];
        while let Some((binary_index, wide_index)) = pending.pop() {
            for (slot, &child) in self.children(binary_index).iter().enumerate() {
                let reference = if self.is_leaf(child) {
                    LEAF | self.push_leaf(child, &mut wide.slots)
                } else {
                    wide.nodes.push(Node::EMPTY);
                    pending.push((child, wide.nodes.len() - 1));
                    wide.nodes.len() as u32 - 1
                };
                let node = &mut wide.nodes[wide_index];
                node.children[slot] = reference;
                node.set_box(slot, self.binary.nodes[child].aabb());
            }
        }
    }

    fn is_leaf(&self, index: usize) -> bool {
        self.counts[index] as usize <= self.leaf_width
    }

    /// The children of a wide node: starting from the binary node `index`, repeatedly replaces the
    /// inner node of the largest area by its two children.
    fn children(&self, index: usize) -> Vec<usize> {
        let mut open = vec![index];
        while open.len() < WIDTH {
            let largest = (0..open.len()).filter(|&i| !self.is_leaf(open[i])).max_by(|&a, &b| {
                let area = |i: usize| self.binary.nodes[open[i]].aabb().half_area();
                area(a).total_cmp(&area(b))
            });
            let Some(largest) = largest else { break };
            let first = self.binary.nodes[open[largest]].first_index as usize;
            open[largest] = first;
            open.push(first + 1);
        }
        open
    }

    /// Appends the items below `index` as a leaf, and returns the leaf's index.
    fn push_leaf(&self, index: usize, slots: &mut Vec<u32>) -> u32 {
        let start = slots.len();
        let mut pending = vec![index];
        while let Some(index) = pending.pop() {
            let node = &self.binary.nodes[index];
            let first = node.first_index as usize;
            if node.is_leaf() {
                slots.extend(&self.binary.primitive_indices[first..first + node.prim_count as usize]);
            } else {
                pending.extend([first + 1, first]);
            }
        }
        slots.resize(start + self.leaf_width, NO_ITEM);
        (start / self.leaf_width) as u32
    }
}

/// Whether `inner` lies inside `outer`.
fn holds(outer: &Aabb, inner: &Aabb) -> bool {
    outer.min.cmple(inner.min).all() && outer.max.cmpge(inner.max).all()
}

/// An `f32` box around an `f64` one; `None` if it is not finite.
pub fn rounded_out(min: glam::DVec3, max: glam::DVec3) -> Option<Aabb> {
    let down = |x: f64| (x as f32).next_down();
    let up = |x: f64| (x as f32).next_up();
    let bounds = Aabb::new(
        Vec3A::new(down(min.x), down(min.y), down(min.z)),
        Vec3A::new(up(max.x), up(max.y), up(max.z)),
    );
    (bounds.min.is_finite() && bounds.max.is_finite()).then_some(bounds)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::geometry::test_scenes::Rng;

    fn random_boxes(count: usize, size: f32) -> Vec<Aabb> {
        let mut rng = Rng::new(count as u64);
        let corner = |rng: &mut Rng| Vec3A::from(Vec3::splat(1.0) + rng.in_cube(size));
        (0..count).map(|_| Aabb::from_points(&[corner(&mut rng), corner(&mut rng)])).collect()
    }

    /// `build` validates in debug; this test does so in every profile.
    #[test]
    fn hierarchies_of_random_equal_flat_and_huge_boxes_are_valid() {
        for count in [1, 2, 3, 7, 8, 9, 64, 65, 500] {
            let equal = vec![Aabb::new(Vec3A::ZERO, Vec3A::ONE); count];
            let flat = vec![Aabb::new(Vec3A::ZERO, Vec3A::ZERO); count];
            for boxes in [random_boxes(count, 1.0), random_boxes(count, 1e15), equal, flat] {
                for leaf_width in [1, WIDTH] {
                    let bvh = Bvh::build(&boxes, leaf_width);
                    bvh.validate(&boxes, leaf_width);
                    assert_eq!(bvh.slots.iter().filter(|&&item| item != NO_ITEM).count(), count);
                }
            }
        }
        let empty = Bvh::build(&[], WIDTH);
        assert!(empty.nodes.is_empty() && empty.slots.is_empty() && !empty.bounds.valid());
    }

    #[test]
    #[should_panic(expected = "is inside its leaf")]
    fn a_box_outside_its_leaf_is_detected() {
        let mut boxes = random_boxes(20, 1.0);
        let bvh = Bvh::build(&boxes, WIDTH);
        boxes[7].max += 10.0;
        bvh.validate(&boxes, WIDTH);
    }

    #[test]
    #[should_panic(expected = "exactly one leaf")]
    fn a_missing_item_is_detected() {
        let boxes = random_boxes(20, 1.0);
        let mut bvh = Bvh::build(&boxes, WIDTH);
        let last = bvh.slots.iter().position(|&item| item == 19).unwrap();
        bvh.slots[last] = NO_ITEM;
        bvh.validate(&boxes, WIDTH);
    }
}
