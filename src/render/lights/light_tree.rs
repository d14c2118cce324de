//! A light tree: a binary hierarchy over many lights whose traversal chooses one light at a point, taking
//! each child with a probability in proportion to its importance there.
//!
//! Takes the [`LightBounds`] of the lights, then a [`LightSampleContext`] and a sample value for each choice;
//! gives the index of a light and the discrete probability of choosing it.
//!
//! Sources: Conty Estevez and Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting* (2018);
//! pbrt-v4, section 12.6.3.

mod split;

use self::split::{Item, NodeBounds, partition};
use super::light_bounds::LightBounds;
use super::light_sample_context::{LightSampleContext, LightSampleContexts};
use super::simd::{ChoiceOfChild, choose_children};
use crate::simd::{LANES, Lanes, lanes_in};

/// The largest number below 1.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - 0.5 * f32::EPSILON;

/// Up to this many lanes are traced through the tree one by one.
const FEW_LANES: u32 = 4;

/// A light chosen in each lane of a mask, which the other lanes have no use for.
#[derive(Clone, Copy, Debug)]
pub struct ChosenLights {
    pub mask: u32,
    pub light: Lanes<u32>,
    pub probability: Lanes,
}

impl ChosenLights {
    pub const NONE: Self = Self { mask: 0, light: [0; LANES], probability: [0.0; LANES] };

    #[inline]
    pub fn set(&mut self, lane: usize, light: usize, probability: f32) {
        self.mask |= 1 << lane;
        self.light[lane] = light as u32;
        self.probability[lane] = probability;
    }
}

/// A tree with one light in every leaf.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    /// The root is the first; the children of a node are adjacent.
    nodes: Vec<Node>,
    /// For each light the index of its leaf, or [`NO_LEAF`].
    leaves: Vec<u32>,
}

const NO_LEAF: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: LightBounds,
    parent: u32,
    content: Content,
}

#[derive(Clone, Copy, Debug)]
enum Content {
    /// Index of the first of the two.
    Children(u32),
    Light(u32),
}

impl LightTree {
    /// Lights are numbered in the given order; `None` is never chosen.
    pub fn new(lights: &[Option<LightBounds>]) -> Self {
        let mut items: Vec<Item> = (0..)
            .zip(lights)
            .filter_map(|(light, bounds)| bounds.map(|bounds| Item { light, bounds }))
            .collect();
        let mut tree = Self { nodes: Vec::new(), leaves: vec![NO_LEAF; lights.len()] };
        if let [first, ..] = items[..] {
            tree.nodes.push(Node { bounds: first.bounds, parent: 0, content: Content::Light(0) });
            tree.build(0, &mut items);
        }
        tree
    }

    /// Builds the subtree of the items below `node`.
    fn build(&mut self, node: usize, items: &mut [Item]) {
        if let [item] = items {
            self.nodes[node].bounds = item.bounds;
            self.nodes[node].content = Content::Light(item.light);
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
        let centre = NodeBounds::new(items).centre();
        self.nodes[node].bounds = self.nodes[first].bounds.union(&self.nodes[first + 1].bounds, centre);
        self.nodes[node].content = Content::Children(first as u32);
    }

    /// Number of lights that may be chosen.
    pub fn len(&self) -> usize {
        self.nodes.len().div_ceil(2)
    }

    /// Returns the bounds of at most `count` nodes that together hold all lights: the widest nodes are divided first.
    pub fn cut(&self, count: usize) -> Vec<LightBounds> {
        let mut cut: Vec<&Node> = self.nodes.first().into_iter().collect();
        while cut.len() < count {
            let inner =
                cut.iter().enumerate().filter(|(_, node)| matches!(node.content, Content::Children(_)));
            let widest = inner.max_by(|(_, a), (_, b)| a.bounds.radius.total_cmp(&b.bounds.radius));
            let Some((i, &Node { content: Content::Children(first), .. })) =
                widest.map(|(i, node)| (i, *node))
            else {
                break;
            };
            cut[i] = &self.nodes[first as usize];
            cut.push(&self.nodes[first as usize + 1]);
        }
        cut.into_iter().map(|node| node.bounds).collect()
    }

    /// Chooses a light by `u` in [0, 1) and returns its index and probability; `None` if the traversal
    /// reaches a node whose lights cannot illuminate the point.
    #[inline]
    pub fn sample(&self, context: &LightSampleContext, u: f32) -> Option<(usize, f32)> {
        self.sample_below(0, context, u, 1.0)
    }

    /// As [`Self::sample`], from a node on that is reached with a probability.
    #[inline]
    fn sample_below(
        &self,
        mut node: usize,
        context: &LightSampleContext,
        mut u: f32,
        mut probability: f32,
    ) -> Option<(usize, f32)> {
        loop {
            let first = match self.nodes.get(node)?.content {
                Content::Light(light) => return Some((light as usize, probability)),
                Content::Children(first) => first as usize,
            };
            let p_first = self.child_probability(first, first + 1, context)?;
            if u < p_first {
                u /= p_first;
                probability *= p_first;
                node = first;
            } else {
                u = ((u - p_first) / (1.0 - p_first)).min(ONE_MINUS_EPSILON);
                probability *= 1.0 - p_first;
                node = first + 1;
            }
        }
    }

    /// As [`Self::sample`] in the lanes of a mask. Lanes go down the tree together as long as they choose the same child.
    pub fn sample_lanes(
        &self,
        mask: u32,
        contexts: &LightSampleContexts,
        u: &Lanes,
        chosen: &mut ChosenLights,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let (mut u, mut probability) = (*u, [1.0; LANES]);
        // Groups have no lane in common
        let mut groups = [(0, 0); LANES];
        groups[0] = (0, mask);
        let mut count = usize::from(mask != 0);
        while count > 0 {
            count -= 1;
            let (node, lanes) = groups[count];
            if lanes.count_ones() <= FEW_LANES {
                for lane in lanes_in(lanes) {
                    let below = self.sample_below(node, &contexts.at(lane), u[lane], probability[lane]);
                    if let Some((light, probability)) = below {
                        chosen.set(lane, light, probability);
                    }
                }
                continue;
            }
            match self.nodes[node].content {
                Content::Light(light) => {
                    lanes_in(lanes).for_each(|lane| chosen.set(lane, light as usize, probability[lane]));
                }
                Content::Children(first) => {
                    let first = first as usize;
                    let children = [first, first + 1].map(|child| &self.nodes[child].bounds);
                    let ChoiceOfChild { first: to_first, second: to_second } =
                        choose_children(lanes, children, contexts, &mut u, &mut probability);
                    for group in [(first, to_first), (first + 1, to_second)] {
                        if group.1 != 0 {
                            groups[count] = group;
                            count += 1;
                        }
                    }
                }
            }
        }
    }

    /// Probability with which [`Self::sample`] chooses a light.
    #[inline]
    pub fn probability(&self, light: usize, context: &LightSampleContext) -> f32 {
        let leaf = self.leaves[light];
        if leaf == NO_LEAF {
            return 0.0;
        }
        let mut node = leaf as usize;
        let mut probability = 1.0;
        while node > 0 {
            // Siblings have the indices 1 and 2, 3 and 4, and so on.
            let sibling = ((node - 1) ^ 1) + 1;
            let Some(p) = self.child_probability(node, sibling, context) else { return 0.0 };
            probability *= p;
            node = self.nodes[node].parent as usize;
        }
        probability
    }

    /// Probability of `node` against its sibling; `None` if neither can illuminate the point.
    #[inline]
    fn child_probability(&self, node: usize, sibling: usize, context: &LightSampleContext) -> Option<f32> {
        let importance = self.nodes[node].bounds.importance(context);
        let sum = importance + self.nodes[sibling].bounds.importance(context);
        (sum > 0.0).then(|| importance / sum)
    }
}
