//! Eight-wide bounding volume hierarchy: obvhs builds a binary one (PLOC with reinsertion), which
//! is collapsed so that one vector instruction works on the boxes of eight children.
//!
//! Sources: Meister and Bittner 2018 (PLOC); Wald, Benthin and Boulos 2008 (wide trees).

use glam::Vec3A;
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};
use std::time::Duration;

/// Children of a node; also the widest leaf.
pub const WIDTH: usize = 8;

/// Marks a child as a leaf; the other bits are then its number.
pub const LEAF: u32 = 1 << 31;

/// Slot of a leaf that holds nothing.
pub const NO_ITEM: u32 = u32::MAX;

/// Eight children. Those that are not there have an inverted box that no ray enters.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Node {
    /// Box planes: for each axis the minima and the maxima.
    pub planes: [[[f32; WIDTH]; 2]; 3],
    /// Index of a node, or [`LEAF`] and the number of a leaf.
    pub children: [u32; WIDTH],
}

impl Node {
    const EMPTY: Self = {
        let inverted = [[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]];
        Self { planes: [inverted; 3], children: [LEAF; WIDTH] }
    };

    fn set_box(&mut self, child: usize, bounds: &Aabb) {
        for (axis, [low, high]) in self.planes.iter_mut().enumerate() {
            low[child] = bounds.min[axis];
            high[child] = bounds.max[axis];
        }
    }
}

/// A hierarchy over boxes. It knows its items by number only.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// The root is the first; empty if there are no items.
    pub nodes: Vec<Node>,
    /// Items of each leaf, `leaf_width` slots a leaf, filled from the front, then [`NO_ITEM`].
    pub slots: Vec<u32>,
    pub bounds: Aabb,
}

impl Bvh {
    /// Builds a hierarchy over finite boxes whose leaves hold at most `leaf_width` of them.
    pub fn build(boxes: &[Aabb], leaf_width: usize) -> Self {
        // Leaves of one item: which subtrees become leaves is decided in the collapse.
        let settings = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let binary = build_bvh2(boxes, settings, &mut Duration::default());
        let mut wide = Self { nodes: Vec::new(), slots: Vec::new(), bounds: Aabb::INVALID };
        if boxes.is_empty() {
            return wide;
        }
        wide.bounds = *binary.nodes[0].aabb();
        Collapse { counts: item_counts(&binary), binary: &binary, leaf_width }.run(&mut wide);
        wide
    }

    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.slots)
    }
}

/// Number of items below each node of a binary hierarchy.
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

struct Collapse<'b> {
    binary: &'b Bvh2,
    counts: Vec<u32>,
    leaf_width: usize,
}

impl Collapse<'_> {
    fn run(&self, wide: &mut Bvh) {
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

    /// Opens the largest inner descendant until the wide node is full.
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

/// The smallest `f32` box around an `f64` one; `None` if it is not finite.
pub fn rounded_out(min: glam::DVec3, max: glam::DVec3) -> Option<Aabb> {
    let down = |x: f64| (x as f32).next_down();
    let up = |x: f64| (x as f32).next_up();
    let bounds = Aabb::new(
        Vec3A::new(down(min.x), down(min.y), down(min.z)),
        Vec3A::new(up(max.x), up(max.y), up(max.z)),
    );
    (bounds.min.is_finite() && bounds.max.is_finite()).then_some(bounds)
}
