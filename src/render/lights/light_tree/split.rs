//! Splits the lights of a tree node into two groups of least cost under the surface area orientation
//! heuristic, evaluated in bins (Conty Estevez and Kulla 2018; pbrt-v4, section 12.6.3).

use glam::Vec3;

use crate::render::lights::light_bounds::LightBounds;

/// Bins along an axis; a node may be split between any two of them.
const BINS: usize = 12;

/// A light while the tree is built.
#[derive(Clone, Copy)]
pub struct Item {
    pub light: u32,
    pub bounds: LightBounds,
}

/// Reorders at least two items into two groups of least cost and returns the length of the first.
pub fn partition(items: &mut [Item]) -> usize {
    // Bin the items by their centres
    let (min, max) = items.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), item| {
        (min.min(item.bounds.centre), max.max(item.bounds.centre))
    });
    let extent = max - min;
    let bin = |item: &Item, axis: usize| {
        let position = (item.bounds.centre[axis] - min[axis]) / extent[axis];
        ((position * BINS as f32) as usize).min(BINS - 1)
    };

    // Find the axis and the split of least cost
    let whole = NodeBounds::new(items).extent();
    let mut best = (f64::INFINITY, 0, 0);
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [const { None::<NodeBounds> }; BINS];
        for item in items.iter() {
            let bounds = &mut bins[bin(item, axis)];
            *bounds = NodeBounds::union_of_some(*bounds, Some(NodeBounds::new(std::slice::from_ref(item))));
        }
        let (cost, split) = cheapest_split(&bins, f64::from(whole.max_element() / whole[axis]));
        if cost < best.0 {
            best = (cost, axis, split);
        }
    }

    // Reorder the items
    let (cost, axis, split) = best;
    if cost == f64::INFINITY {
        return items.len() / 2;
    }
    items.sort_by_key(|item| bin(item, axis) >= split);
    items.partition_point(|item| bin(item, axis) < split)
}

/// Least cost of a split between two bins, and the index of the first bin above it. `regularity` is the
/// ratio of the longest side of the node's box to the side along the axis, by which the heuristic penalises
/// thin slabs.
fn cheapest_split(bins: &[Option<NodeBounds>; BINS], regularity: f64) -> (f64, usize) {
    let mut cost_above = [0.0; BINS];
    let mut above = None;
    for i in (1..BINS).rev() {
        above = NodeBounds::union_of_some(above, bins[i]);
        cost_above[i] = above.map_or(f64::INFINITY, |bounds| bounds.cost());
    }
    let mut best = (f64::INFINITY, 0);
    let mut below = None;
    for i in 1..BINS {
        below = NodeBounds::union_of_some(below, bins[i - 1]);
        let cost_below = below.map_or(f64::INFINITY, |bounds| bounds.cost());
        let cost = regularity * (cost_below + cost_above[i]);
        if cost < best.0 {
            best = (cost, i);
        }
    }
    best
}

/// Bounds of the lights of a node, with their axis-aligned box.
#[derive(Clone, Copy)]
pub struct NodeBounds {
    min: Vec3,
    max: Vec3,
    bounds: LightBounds,
}

impl NodeBounds {
    /// Bounds of at least one item.
    pub fn new(items: &[Item]) -> Self {
        let leaf = |item: &Item| Self {
            min: item.bounds.centre - item.bounds.radius,
            max: item.bounds.centre + item.bounds.radius,
            bounds: item.bounds,
        };
        items[1..].iter().map(leaf).fold(leaf(&items[0]), |a, b| a.union(&b))
    }

    fn union(&self, other: &Self) -> Self {
        let (min, max) = (self.min.min(other.min), self.max.max(other.max));
        Self { min, max, bounds: self.bounds.union(&other.bounds, 0.5 * (min + max)) }
    }

    fn union_of_some(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        match (a, b) {
            (Some(a), Some(b)) => Some(a.union(&b)),
            (a, b) => a.or(b),
        }
    }

    pub fn centre(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Intensity, times the measures of the extents in space and direction. The squared diagonal replaces
    /// the surface area, since it does not vanish for lights in a row.
    fn cost(&self) -> f64 {
        f64::from(self.bounds.intensity)
            * self.bounds.orientation_measure()
            * f64::from(self.extent().length_squared())
    }
}
