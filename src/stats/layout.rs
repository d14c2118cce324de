//! The layout of a sample vector: its enabled dimensions, their names, groups and indices.

use super::block::{BLOCKS, Block, Dimension, Feature, Group};
use super::block_set::BlockSet;

/// An invariant of a layout that does not hold.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    #[error("{0:?} is not in its place in the table of blocks")]
    Order(Block),
    #[error("{0:?} is disabled; it is always enabled")]
    Disabled(Block),
    #[error("{block:?} starts at {found}; the block before it ends at {expected}")]
    Start { block: Block, found: usize, expected: usize },
    #[error("{0:?} has dimensions that are not its own")]
    Dimensions(Block),
    #[error("found {found} dimensions; the blocks have {expected}")]
    Length { found: usize, expected: usize },
}

/// The dimensions of a sample and their indices. Record sizes, statistics planes, mutual-information pairs
/// and filter terms follow from it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    dimensions: Vec<Dimension>,
    starts: [Option<usize>; BLOCKS.len()],
    /// Blocks that the scene calls for and the layout does not have.
    left_out: BlockSet,
}

impl Layout {
    /// A layout of the blocks for which `is_enabled` is true; film position and colour are always enabled.
    pub fn with_blocks(is_enabled: impl Fn(Block) -> bool) -> Self {
        Self::new(|block| block == Block::Film || is_enabled(block), BlockSet::NONE)
    }

    /// The layout that keeps only the blocks in `kept`. The colour always stays.
    pub fn restricted_to(&self, kept: BlockSet) -> Self {
        let is_left_out = |&block: &Block| self.block(block).is_some() && !kept.contains(block);
        let left_out = BLOCKS.iter().map(|&(block, _)| block).filter(is_left_out);
        let left_out = left_out.filter(|&block| block != Block::Colour).collect();
        let is_kept = |block| self.block(block).is_some() && kept.contains(block);
        Self::new(is_kept, self.left_out | left_out)
    }

    fn new(is_enabled: impl Fn(Block) -> bool, left_out: BlockSet) -> Self {
        let mut dimensions = Vec::new();
        let starts = BLOCKS.map(|(block, dims)| {
            let enabled = block == Block::Colour || is_enabled(block);
            enabled.then(|| {
                let start = dimensions.len();
                dimensions.extend_from_slice(dims);
                start
            })
        });
        let layout = Self { dimensions, starts, left_out };
        debug_assert_eq!(layout.validate(), Ok(()));
        layout
    }

    /// Checks the invariants: enabled blocks follow each other in the order of [`Block`] without gaps, each
    /// with its own dimensions, and the colour is among them.
    ///
    /// # Errors
    /// The first invariant that does not hold.
    pub fn validate(&self) -> Result<(), LayoutError> {
        let mut end = 0;
        for (index, (block, dimensions)) in BLOCKS.into_iter().enumerate() {
            let check = |holds: bool, error: LayoutError| if holds { Ok(()) } else { Err(error) };
            check(block as usize == index, LayoutError::Order(block))?;
            let Some(range) = self.block(block) else {
                check(block != Block::Colour, LayoutError::Disabled(block))?;
                continue;
            };
            check(range.start == end, LayoutError::Start { block, found: range.start, expected: end })?;
            check(self.dimensions.get(range.clone()) == Some(dimensions), LayoutError::Dimensions(block))?;
            end = range.end;
        }
        match self.len() {
            found if found == end => Ok(()),
            found => Err(LayoutError::Length { found, expected: end }),
        }
    }

    /// The layout whose dimensions have the first names, and that leaves out those of the second, both in the order of
    /// a sample; `None` if there is none.
    pub fn from_names<S: AsRef<str>>(names: &[S], left_out: &[S]) -> Option<Self> {
        let is_in = |block: Block, names: &[S]| {
            BLOCKS[block as usize].1.iter().all(|d| names.iter().any(|name| name.as_ref() == d.name))
        };
        let blocks = BLOCKS.iter().map(|&(block, _)| block);
        let left_out_blocks = blocks.filter(|&block| is_in(block, left_out)).collect();
        let layout = Self::new(|block| is_in(block, names), left_out_blocks);
        let same = |a: &[S], b: &[&str]| a.iter().map(AsRef::as_ref).eq(b.iter().copied());
        let found: Vec<_> = layout.names().collect();
        (same(names, &found) && same(left_out, &layout.names_left_out(|_| true))).then_some(layout)
    }

    /// The enabled blocks, with which [`Self::restricted_to`] gives this layout again.
    pub fn blocks(&self) -> BlockSet {
        BLOCKS.iter().map(|&(block, _)| block).filter(|&block| self.block(block).is_some()).collect()
    }

    /// Tests whether the scene calls for a block that this layout leaves out.
    pub fn leaves_out(&self, block: Block) -> bool {
        self.left_out.contains(block) && self.block(block).is_none()
    }

    /// The names of the dimensions that the scene calls for and this layout leaves out, of the blocks for which
    /// `is_read` is true.
    pub fn names_left_out(&self, is_read: impl Fn(&Block) -> bool) -> Vec<&'static str> {
        let blocks = BLOCKS.iter().filter(|(block, _)| self.leaves_out(*block) && is_read(block));
        blocks.flat_map(|(_, dimensions)| dimensions.iter().map(|d| d.name)).collect()
    }

    /// The names of the dimensions, in the order of a sample.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &'static str> {
        self.dimensions.iter().map(|dimension| dimension.name)
    }

    /// The names of the dimensions that the scene calls for, kept or left out, in the order of a sample.
    pub fn enabled_names(&self) -> Vec<&'static str> {
        let is_enabled = |block: Block| self.block(block).is_some() || self.leaves_out(block);
        let blocks = BLOCKS.iter().filter(|(block, _)| is_enabled(*block));
        blocks.flat_map(|(_, dimensions)| dimensions.iter().map(|d| d.name)).collect()
    }

    /// Length of a sample: the number of enabled dimensions, auxiliary ones included.
    pub fn len(&self) -> usize {
        self.dimensions.len()
    }

    /// Always false: the colour is always enabled.
    pub fn is_empty(&self) -> bool {
        self.dimensions.is_empty()
    }

    pub fn dimensions(&self) -> &[Dimension] {
        &self.dimensions
    }

    /// Indices of a block's dimensions; `None` if it is disabled.
    pub fn block(&self, block: Block) -> Option<std::ops::Range<usize>> {
        let i = block as usize;
        self.starts[i].map(|start| start..start + BLOCKS[i].1.len())
    }

    /// Indices of the film position; empty if it is left out.
    pub fn film(&self) -> std::ops::Range<usize> {
        self.block(Block::Film).unwrap_or(0..0)
    }

    /// Indices of the colour.
    pub fn colour(&self) -> std::ops::Range<usize> {
        self.block(Block::Colour).expect("the colour is always enabled")
    }

    /// Indices of the radiance with directly visible emission: of [`Block::Radiance`] or, if that is
    /// disabled, the colour.
    pub fn radiance(&self) -> std::ops::Range<usize> {
        self.block(Block::Radiance).unwrap_or(self.colour())
    }

    /// Indices of all features, with their kinds.
    pub fn features(&self) -> Vec<(usize, Feature)> {
        let kind = |(i, d): (usize, &Dimension)| match d.group {
            Group::Feature(kind) => Some((i, kind)),
            _ => None,
        };
        self.dimensions.iter().enumerate().filter_map(kind).collect()
    }

    /// Indices of all random parameters.
    pub fn randoms(&self) -> Vec<usize> {
        let random = |(i, d): (usize, &Dimension)| (d.group == Group::Random).then_some(i);
        self.dimensions.iter().enumerate().filter_map(random).collect()
    }

    /// Copies a block's values to a sample; does nothing if the block is disabled.
    #[inline]
    pub fn write(&self, sample: &mut [f32], block: Block, values: &[f32]) {
        if let Some(range) = self.block(block) {
            sample[range].copy_from_slice(values);
        }
    }
}

#[cfg(test)]
mod tests;
