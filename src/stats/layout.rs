//! The layout of a sample vector: its enabled dimensions, their names, groups and indices.

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
}

impl Layout {
    /// A layout of the blocks for which `is_enabled` is true; film position and colour are always enabled.
    pub fn with_blocks(is_enabled: impl Fn(Block) -> bool) -> Self {
        let mut dimensions = Vec::new();
        let starts = ALL.map(|(block, dims)| {
            let enabled = matches!(block, Block::Film | Block::Colour) || is_enabled(block);
            enabled.then(|| {
                let start = dimensions.len();
                dimensions.extend_from_slice(dims);
                start
            })
        });
        let layout = Self { dimensions, starts };
        debug_assert_eq!(layout.validate(), Ok(()));
        layout
    }

    /// Checks the invariants: enabled blocks follow each other in the order of [`Block`] without gaps, each
    /// with its own dimensions, and film position and colour are among them.
    ///
    /// # Errors
    /// The first invariant that does not hold.
    pub fn validate(&self) -> Result<(), LayoutError> {
        let mut end = 0;
        for (index, (block, dimensions)) in ALL.into_iter().enumerate() {
            let check = |holds: bool, error: LayoutError| if holds { Ok(()) } else { Err(error) };
            check(block as usize == index, LayoutError::Order(block))?;
            let Some(range) = self.block(block) else {
                check(!matches!(block, Block::Film | Block::Colour), LayoutError::Disabled(block))?;
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

    /// The layout whose dimensions have these names, in this order; `None` if none has.
    pub fn from_names<S: AsRef<str>>(names: &[S]) -> Option<Self> {
        let named = |name: &str| names.iter().any(|n| n.as_ref() == name);
        let layout = Self::with_blocks(|block| ALL[block as usize].1.iter().all(|d| named(d.name)));
        let same = layout.dimensions.iter().map(|d| d.name).eq(names.iter().map(AsRef::as_ref));
        same.then_some(layout)
    }

    /// The names of the dimensions, in the order of a sample.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &'static str> {
        self.dimensions.iter().map(|dimension| dimension.name)
    }

    /// Length of a sample: the number of enabled dimensions, auxiliary ones included.
    pub fn len(&self) -> usize {
        self.dimensions.len()
    }

    /// Always false: film position and colour are always enabled.
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

    /// Indices of the film position.
    pub fn film(&self) -> std::ops::Range<usize> {
        self.enabled_block(Block::Film)
    }

    /// Indices of the colour.
    pub fn colour(&self) -> std::ops::Range<usize> {
        self.enabled_block(Block::Colour)
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

    fn enabled_block(&self, block: Block) -> std::ops::Range<usize> {
        self.block(block).expect("film position and colour are always enabled")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_blocks_give_the_papers_27_dimensions() {
        let layout = Layout::with_blocks(|_| true);
        let vector = layout.dimensions().iter().filter(|d| d.group != Group::Auxiliary).count();
        assert_eq!(vector, 27);
        assert_eq!(layout.features().len(), 15);
        assert_eq!(layout.randoms().len(), 7);
    }

    #[test]
    fn the_table_is_in_the_order_of_blocks() {
        assert!(ALL.iter().enumerate().all(|(i, (block, _))| *block as usize == i));
    }

    #[test]
    fn names_determine_the_layout() {
        for is_enabled in [|_| true, |b| b == Block::Lens, |b| b == Block::Hit || b == Block::Normal2] {
            let layout = Layout::with_blocks(is_enabled);
            let names: Vec<_> = layout.dimensions().iter().map(|d| d.name).collect();
            assert_eq!(Layout::from_names(&names), Some(layout));
            assert_eq!(Layout::from_names(&names[1..]), None);
        }
        assert_eq!(Layout::from_names(&["film.x", "film.y", "R", "G", "B", "lens.u"]), None);
    }

    #[test]
    fn writing_a_disabled_block_changes_nothing() {
        let layout = Layout::with_blocks(|_| false);
        let mut sample = vec![0.0; layout.len()];
        layout.write(&mut sample, Block::Lens, &[1.0, 1.0]);
        assert!(sample.iter().all(|&v| v == 0.0));
        layout.write(&mut sample, Block::Colour, &[1.0, 2.0, 3.0]);
        assert_eq!(sample[layout.colour()], [1.0, 2.0, 3.0]);
    }

    #[test]
    fn blocks_follow_each_other_without_gaps() {
        let dropped = ALL.map(|(block, _)| block).map(|block| move |b: Block| b != block);
        for is_enabled in dropped {
            let layout = Layout::with_blocks(is_enabled);
            layout.validate().unwrap();
            let mut end = 0;
            for (block, dims) in ALL {
                let expected = matches!(block, Block::Film | Block::Colour) || is_enabled(block);
                assert_eq!(layout.block(block).is_some(), expected, "{block:?}");
                if let Some(range) = layout.block(block) {
                    assert_eq!(range, end..end + dims.len());
                    assert_eq!(layout.dimensions()[range.clone()], *dims);
                    end = range.end;
                }
            }
            assert_eq!((layout.len(), layout.is_empty()), (end, false));
            assert_eq!((layout.film(), layout.colour()), (0..2, 2..5));
            assert_eq!(layout.radiance(), layout.block(Block::Radiance).unwrap_or(2..5));
        }
        assert_eq!(MAX_DIMENSIONS, 34);
    }
}
