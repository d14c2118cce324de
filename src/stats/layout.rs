//! The layout of a sample vector: its enabled dimensions, their names, groups and indices.

use super::block_set::BlockSet;

/// The kind of a dimension, which decides how a filter treats it (Sen and Darabi 2012, section 3: p, c,
/// f, r).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Position on the film, in pixels of the whole image.
    Position,
    /// Radiance that is filtered: all but directly visible emission.
    Colour,
    /// A feature of the first or second hit.
    Feature(Feature),
    /// A random parameter, in [0, 1).
    Random,
    /// Not part of the vector that P-RPF filters; a filter or an output reads its moments.
    Auxiliary,
}

/// The kind of a feature. Each has its own similarity threshold in the choice of neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Render-space position divided by the scene's diameter, so of order 1.
    WorldPosition,
    /// Component of a unit normal, in [-1, 1].
    Normal,
    /// Reflectance, in [0, 1].
    Albedo,
}

/// One dimension of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension {
    /// The name in files and reports, e.g. `P1.x`.
    pub name: &'static str,
    pub group: Group,
}

/// A block of consecutive dimensions, enabled or disabled as a whole. Comments give the number of its
/// dimensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    /// Film position (2).
    Film,
    /// Radiance without directly visible emission (3).
    Colour,
    /// First hit: position (3).
    Position1,
    /// First hit: shading normal (3).
    Normal1,
    /// First hit: albedo (3).
    Albedo,
    /// Second hit: position (3).
    Position2,
    /// Second hit: shading normal (3).
    Normal2,
    /// Random numbers of the lens sample (2).
    Lens,
    /// Random number of the time sample (1).
    Time,
    /// Random numbers of light sampling at the first hit (2).
    Light1,
    /// Random numbers of BSDF sampling at the first hit (2).
    Bsdf1,
    /// Auxiliary: radiance with directly visible emission (3). Disabled if no emission is visible, since
    /// it then equals [`Block::Colour`].
    Radiance,
    /// Auxiliary: directly visible emission (3), the difference between [`Block::Radiance`] and
    /// [`Block::Colour`].
    Emission,
    /// Auxiliary: 1 where the camera ray hit a surface, else 0 (1).
    Hit,
}

/// The dimensions of each block, in the order of [`Block`]'s variants, which is the order in a sample.
const ALL: [(Block, &[Dimension]); 14] = {
    use Feature::{Albedo, Normal, WorldPosition};
    const fn dim(name: &'static str, group: Group) -> Dimension {
        Dimension { name, group }
    }
    const fn feature(name: &'static str, kind: Feature) -> Dimension {
        Dimension { name, group: Group::Feature(kind) }
    }
    [
        (Block::Film, &[dim("film.x", Group::Position), dim("film.y", Group::Position)]),
        (Block::Colour, &[dim("R", Group::Colour), dim("G", Group::Colour), dim("B", Group::Colour)]),
        (
            Block::Position1,
            &[feature("P1.x", WorldPosition), feature("P1.y", WorldPosition), feature("P1.z", WorldPosition)],
        ),
        (Block::Normal1, &[feature("N1.x", Normal), feature("N1.y", Normal), feature("N1.z", Normal)]),
        (
            Block::Albedo,
            &[feature("albedo.r", Albedo), feature("albedo.g", Albedo), feature("albedo.b", Albedo)],
        ),
        (
            Block::Position2,
            &[feature("P2.x", WorldPosition), feature("P2.y", WorldPosition), feature("P2.z", WorldPosition)],
        ),
        (Block::Normal2, &[feature("N2.x", Normal), feature("N2.y", Normal), feature("N2.z", Normal)]),
        (Block::Lens, &[dim("lens.u", Group::Random), dim("lens.v", Group::Random)]),
        (Block::Time, &[dim("time", Group::Random)]),
        (Block::Light1, &[dim("light1.u", Group::Random), dim("light1.v", Group::Random)]),
        (Block::Bsdf1, &[dim("bsdf1.u", Group::Random), dim("bsdf1.v", Group::Random)]),
        (
            Block::Radiance,
            &[
                dim("radiance.r", Group::Auxiliary),
                dim("radiance.g", Group::Auxiliary),
                dim("radiance.b", Group::Auxiliary),
            ],
        ),
        (
            Block::Emission,
            &[
                dim("emission.r", Group::Auxiliary),
                dim("emission.g", Group::Auxiliary),
                dim("emission.b", Group::Auxiliary),
            ],
        ),
        (Block::Hit, &[dim("hit", Group::Auxiliary)]),
    ]
};

/// The names of the dimensions of each block, in the order of a sample.
pub fn block_names() -> impl Iterator<Item = Vec<&'static str>> {
    ALL.iter().map(|(_, dimensions)| dimensions.iter().map(|dimension| dimension.name).collect())
}

/// Number of dimensions of a sample with all blocks enabled.
pub const MAX_DIMENSIONS: usize = {
    let (mut sum, mut i) = (0, 0);
    while i < ALL.len() {
        sum += ALL[i].1.len();
        i += 1;
    }
    sum
};

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
    starts: [Option<usize>; ALL.len()],
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
        let left_out = ALL.iter().map(|&(block, _)| block).filter(is_left_out);
        let left_out = left_out.filter(|&block| block != Block::Colour).collect();
        let is_kept = |block| self.block(block).is_some() && kept.contains(block);
        Self::new(is_kept, self.left_out | left_out)
    }

    fn new(is_enabled: impl Fn(Block) -> bool, left_out: BlockSet) -> Self {
        let mut dimensions = Vec::new();
        let starts = ALL.map(|(block, dims)| {
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
        for (index, (block, dimensions)) in ALL.into_iter().enumerate() {
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
            ALL[block as usize].1.iter().all(|d| names.iter().any(|name| name.as_ref() == d.name))
        };
        let blocks = ALL.iter().map(|&(block, _)| block);
        let left_out_blocks = blocks.filter(|&block| is_in(block, left_out)).collect();
        let layout = Self::new(|block| is_in(block, names), left_out_blocks);
        let same = |a: &[S], b: &[&str]| a.iter().map(AsRef::as_ref).eq(b.iter().copied());
        let found: Vec<_> = layout.names().collect();
        (same(names, &found) && same(left_out, &layout.names_left_out(|_| true))).then_some(layout)
    }

    /// The enabled blocks, with which [`Self::restricted_to`] gives this layout again.
    pub fn blocks(&self) -> BlockSet {
        ALL.iter().map(|&(block, _)| block).filter(|&block| self.block(block).is_some()).collect()
    }

    /// Tests whether the scene calls for a block that this layout leaves out.
    pub fn leaves_out(&self, block: Block) -> bool {
        self.left_out.contains(block) && self.block(block).is_none()
    }

    /// The names of the dimensions that the scene calls for and this layout leaves out, of the blocks for which
    /// `is_read` is true.
    pub fn names_left_out(&self, is_read: impl Fn(&Block) -> bool) -> Vec<&'static str> {
        let blocks = ALL.iter().filter(|(block, _)| self.leaves_out(*block) && is_read(block));
        blocks.flat_map(|(_, dimensions)| dimensions.iter().map(|d| d.name)).collect()
    }

    /// The names of the dimensions, in the order of a sample.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &'static str> {
        self.dimensions.iter().map(|dimension| dimension.name)
    }

    /// The names of the dimensions that the scene calls for, kept or left out, in the order of a sample.
    pub fn enabled_names(&self) -> Vec<&'static str> {
        let is_enabled = |block: Block| self.block(block).is_some() || self.leaves_out(block);
        let blocks = ALL.iter().filter(|(block, _)| is_enabled(*block));
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
        self.starts[i].map(|start| start..start + ALL[i].1.len())
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
