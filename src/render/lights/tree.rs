//! Choice among many lights by what could arrive at a point: a binary tree of lights, down which
//! every step is taken in proportion to the importance of the two sides.
//!
//! Sources: Conty Estevez and Kulla 2018; pbrt-v4, section 12.6.3.

use glam::Vec3;

use super::BELOW_ONE;
use super::bounds::{LightBounds, Receiver};

/// Cells along an axis between which a node may be split.
const BINS: usize = 12;

/// A tree with one light in every leaf.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    /// The root is the first; the children of a node are next to each other.
    nodes: Vec<Node>,
    /// For each light its leaf, or [`NO_LEAF`].
    leaves: Vec<u32>,
}

const NO_LEAF: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: LightBounds,
    parent: u32,
    below: Below,
}

#[derive(Clone, Copy, Debug)]
enum Below {
    /// Index of the first of the two.
    Children(u32),
    Light(u32),
}

impl LightTree {
    /// Lights are numbered in their order; those that are `None` are never chosen.
    pub fn new(lights: &[Option<LightBounds>]) -> Self {
        let mut items: Vec<Item> = (0..)
            .zip(lights)
            .filter_map(|(light, bounds)| bounds.map(|bounds| Item { light, bounds }))
            .collect();
        let mut tree = Self { nodes: Vec::new(), leaves: vec![NO_LEAF; lights.len()] };
        if let [first, ..] = items[..] {
            tree.nodes.push(Node { bounds: first.bounds, parent: 0, below: Below::Light(0) });
            tree.build(0, &mut items);
        }
        tree
    }

    /// Makes `node` the root of a tree of the items.
    fn build(&mut self, node: usize, items: &mut [Item]) {
        if let [item] = items {
            self.nodes[node].bounds = item.bounds;
            self.nodes[node].below = Below::Light(item.light);
            self.leaves[item.light as usize] = node as u32;
            return;
        }
        let middle = partition(items);
        let (left, right) = items.split_at_mut(middle);
        let first = self.nodes.len();
        let child = Node { parent: node as u32, ..self.nodes[node] };
        self.nodes.extend([child, child]);
        self.build(first, left);
        self.build(first + 1, right);
        let centre = Cell::of(items).centre();
        self.nodes[node].bounds = self.nodes[first].bounds.union(&self.nodes[first + 1].bounds, centre);
        self.nodes[node].below = Below::Children(first as u32);
    }

    /// Number of lights that may be chosen.
    pub fn len(&self) -> usize {
        self.nodes.len().div_ceil(2)
    }

    /// Bounds of all lights together.
    #[inline]
    pub fn bounds(&self) -> Option<&LightBounds> {
        self.nodes.first().map(|root| &root.bounds)
    }

    /// A light for a number in [0, 1), with its probability; `None` if none can reach the receiver.
    #[inline]
    pub fn sample(&self, receiver: &Receiver, mut u: f32) -> Option<(usize, f32)> {
        let mut node = self.nodes.first()?;
        let mut probability = 1.0;
        loop {
            let first = match node.below {
                Below::Light(light) => return Some((light as usize, probability)),
                Below::Children(first) => first as usize,
            };
            let share = self.share(first, first + 1, receiver)?;
            if u < share {
                u /= share;
                probability *= share;
                node = &self.nodes[first];
            } else {
                u = ((u - share) / (1.0 - share)).min(BELOW_ONE);
                probability *= 1.0 - share;
                node = &self.nodes[first + 1];
            }
        }
    }

    /// Probability with which [`Self::sample`] chooses a light.
    #[inline]
    pub fn probability(&self, light: usize, receiver: &Receiver) -> f32 {
        let leaf = self.leaves[light];
        if leaf == NO_LEAF {
            return 0.0;
        }
        let mut node = leaf as usize;
        let mut probability = 1.0;
        while node > 0 {
            // Children stand at 1 and 2, 3 and 4, and so on.
            let sibling = ((node - 1) ^ 1) + 1;
            let Some(share) = self.share(node, sibling, receiver) else { return 0.0 };
            probability *= share;
            node = self.nodes[node].parent as usize;
        }
        probability
    }

    /// Probability of `node` against its sibling; `None` if neither can reach the receiver.
    #[inline]
    fn share(&self, node: usize, sibling: usize, receiver: &Receiver) -> Option<f32> {
        let own = self.nodes[node].bounds.importance(receiver);
        let sum = own + self.nodes[sibling].bounds.importance(receiver);
        (sum > 0.0).then(|| own / sum)
    }
}

/// A light while the tree is built.
#[derive(Clone, Copy)]
struct Item {
    light: u32,
    bounds: LightBounds,
}

/// Splits items into two parts that cost least (the surface area orientation heuristic), and
/// returns the length of the first. There are at least two.
fn partition(items: &mut [Item]) -> usize {
    let centres = items.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), item| {
        (min.min(item.bounds.centre), max.max(item.bounds.centre))
    });
    let extent = centres.1 - centres.0;
    let bin = |item: &Item, axis: usize| {
        let position = (item.bounds.centre[axis] - centres.0[axis]) / extent[axis];
        ((position * BINS as f32) as usize).min(BINS - 1)
    };
    let whole = Cell::of(items).extent();
    let mut best = (f64::INFINITY, 0, 0);
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [const { None::<Cell> }; BINS];
        for item in items.iter() {
            let cell = &mut bins[bin(item, axis)];
            *cell = Cell::joined(*cell, Some(Cell::of(std::slice::from_ref(item))));
        }
        let mut above = [0.0; BINS];
        let mut sum = None;
        for i in (1..BINS).rev() {
            sum = Cell::joined(sum, bins[i]);
            above[i] = sum.map_or(f64::INFINITY, |cell| cell.cost());
        }
        let mut below = None;
        // Thin slabs are no better than their longest side.
        let regularity = f64::from(whole.max_element() / whole[axis]);
        for i in 1..BINS {
            below = Cell::joined(below, bins[i - 1]);
            let cost = regularity * (below.map_or(f64::INFINITY, |cell| cell.cost()) + above[i]);
            if cost < best.0 {
                best = (cost, axis, i);
            }
        }
    }
    let (cost, axis, split) = best;
    if cost == f64::INFINITY {
        return items.len() / 2;
    }
    items.sort_by_key(|item| bin(item, axis) >= split);
    items.partition_point(|item| bin(item, axis) < split)
}

/// Bounds of some items, with a box.
#[derive(Clone, Copy)]
struct Cell {
    min: Vec3,
    max: Vec3,
    bounds: LightBounds,
}

impl Cell {
    fn of(items: &[Item]) -> Self {
        let cell = |item: &Item| Self {
            min: item.bounds.centre - item.bounds.radius,
            max: item.bounds.centre + item.bounds.radius,
            bounds: item.bounds,
        };
        items[1..].iter().map(cell).fold(cell(&items[0]), |a, b| a.join(&b))
    }

    fn join(&self, other: &Self) -> Self {
        let (min, max) = (self.min.min(other.min), self.max.max(other.max));
        Self { min, max, bounds: self.bounds.union(&other.bounds, 0.5 * (min + max)) }
    }

    fn joined(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        match (a, b) {
            (Some(a), Some(b)) => Some(a.join(&b)),
            (a, b) => a.or(b),
        }
    }

    fn centre(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Intensity, spread over space and directions. The squared diagonal stands for the surface
    /// area, since it does not vanish for lights in a row.
    fn cost(&self) -> f64 {
        f64::from(self.bounds.intensity)
            * self.bounds.orientation_measure()
            * f64::from(self.extent().length_squared())
    }
}
