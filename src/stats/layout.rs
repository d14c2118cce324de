//! The sample vector: which of its dimensions are alive, decided once by the scene's effects.

use crate::scene::Effects;

/// What a dimension is, and so how the filter treats it (paper, section 3: p, c, f, r).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Position on the film, in pixels of the whole image.
    Position,
    /// Radiance that is filtered: everything but directly visible emission.
    Colour,
    /// A feature of the first or second hit.
    Feature(Feature),
    /// A random parameter, in [0, 1).
    Random,
    /// Not part of the sample vector; means and deviations are kept for other uses.
    Auxiliary,
}

/// The kinds of features; they differ in tolerance when neighbours are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Render-space position over the scene's diameter, so of order 1.
    WorldPosition,
    /// Component of a unit normal, in [-1, 1].
    Normal,
    /// Reflectance, in [0, 1].
    Albedo,
}

/// One dimension of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension {
    /// As in files and reports, e.g. `P1.x`.
    pub name: &'static str,
    pub group: Group,
}

/// A block of consecutive dimensions that belong together, present or absent as a whole.
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
    /// Lens numbers (2).
    Lens,
    /// Shutter number (1).
    Time,
    /// Light-sampling numbers at the first hit (2).
    Light1,
    /// BSDF-sampling numbers at the first hit (2).
    Bsdf1,
    /// Auxiliary: radiance with everything (3). Absent where nothing emissive can be seen, since
    /// then it equals [`Block::Colour`].
    Radiance,
    /// Auxiliary: directly visible emission (3), what [`Block::Radiance`] has beyond
    /// [`Block::Colour`].
    Emission,
    /// Auxiliary: 1 where the camera ray hit a surface, else 0 (1).
    Hit,
}

/// In the order of [`Block`]'s variants, which is the order in a sample.
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

/// Dimensions of a sample when everything is alive.
pub const MAX_DIMENSIONS: usize = {
    let (mut sum, mut i) = (0, 0);
    while i < ALL.len() {
        sum += ALL[i].1.len();
        i += 1;
    }
    sum
};

/// Which dimensions a sample has, and where. Everything downstream (record size, statistics
/// planes, mutual-information pairs, filter terms) iterates over it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    dimensions: Vec<Dimension>,
    starts: [Option<usize>; ALL.len()],
}

impl Layout {
    /// The layout that a scene with these effects needs: 27 dimensions and the auxiliary ones
    /// when everything is on.
    pub fn for_effects(effects: &Effects) -> Self {
        Self::with_blocks(|block| match block {
            Block::Film | Block::Colour | Block::Position1 | Block::Normal1 | Block::Hit => true,
            Block::Albedo => effects.varied_albedo,
            Block::Position2 | Block::Normal2 => effects.second_hit,
            Block::Lens => effects.lens,
            Block::Time => effects.motion,
            Block::Light1 => effects.extended_lights,
            Block::Bsdf1 => effects.second_hit,
            Block::Radiance | Block::Emission => effects.visible_emission,
        })
    }

    /// A layout of chosen blocks; film position and colour are always there.
    pub fn with_blocks(alive: impl Fn(Block) -> bool) -> Self {
        let mut dimensions = Vec::new();
        let starts = ALL.map(|(block, dims)| {
            let on = matches!(block, Block::Film | Block::Colour) || alive(block);
            on.then(|| {
                let start = dimensions.len();
                dimensions.extend_from_slice(dims);
                start
            })
        });
        Self { dimensions, starts }
    }

    /// The layout whose dimensions have these names, in this order; `None` if there is none.
    pub fn of_names<S: AsRef<str>>(names: &[S]) -> Option<Self> {
        let named = |name: &str| names.iter().any(|n| n.as_ref() == name);
        let layout = Self::with_blocks(|block| ALL[block as usize].1.iter().all(|d| named(d.name)));
        let same = layout.dimensions.iter().map(|d| d.name).eq(names.iter().map(AsRef::as_ref));
        same.then_some(layout)
    }

    /// Number of alive dimensions, auxiliary ones included: the length of a sample.
    pub fn len(&self) -> usize {
        self.dimensions.len()
    }

    /// Never true: film position and colour are always alive.
    pub fn is_empty(&self) -> bool {
        self.dimensions.is_empty()
    }

    pub fn dimensions(&self) -> &[Dimension] {
        &self.dimensions
    }

    /// Indices of a block's dimensions; `None` where it is not alive.
    pub fn block(&self, block: Block) -> Option<std::ops::Range<usize>> {
        let i = block as usize;
        self.starts[i].map(|start| start..start + ALL[i].1.len())
    }

    /// Indices of the film position.
    pub fn film(&self) -> std::ops::Range<usize> {
        self.always(Block::Film)
    }

    /// Indices of the colour.
    pub fn colour(&self) -> std::ops::Range<usize> {
        self.always(Block::Colour)
    }

    /// Indices of the radiance with directly visible emission.
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

    /// Copies a block's values into a sample; nothing where the block is not alive.
    #[inline]
    pub fn write(&self, sample: &mut [f32], block: Block, values: &[f32]) {
        if let Some(range) = self.block(block) {
            sample[range].copy_from_slice(values);
        }
    }

    fn always(&self, block: Block) -> std::ops::Range<usize> {
        self.block(block).expect("film position and colour are in every layout")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_on_gives_the_papers_27_dimensions() {
        let layout = Layout::with_blocks(|_| true);
        let vector = layout.dimensions().iter().filter(|d| d.group != Group::Auxiliary).count();
        assert_eq!(vector, 27);
        assert_eq!(layout.features().len(), 15);
        assert_eq!(layout.randoms().len(), 7);
    }

    #[test]
    fn the_table_of_blocks_is_in_their_order() {
        assert!(ALL.iter().enumerate().all(|(i, (block, _))| *block as usize == i));
    }

    #[test]
    fn a_scene_without_effects_has_no_random_dimension() {
        let layout = Layout::for_effects(&Effects::default());
        assert!(layout.randoms().is_empty());
        assert_eq!(layout.features().len(), 6);
        assert_eq!(layout.radiance(), layout.colour());
        assert_eq!(layout.block(Block::Lens), None);
    }

    #[test]
    fn a_layout_is_known_by_its_names() {
        for alive in [|_| true, |b| b == Block::Lens, |b| b == Block::Hit || b == Block::Normal2] {
            let layout = Layout::with_blocks(alive);
            let names: Vec<_> = layout.dimensions().iter().map(|d| d.name).collect();
            assert_eq!(Layout::of_names(&names), Some(layout));
            assert_eq!(Layout::of_names(&names[1..]), None);
        }
        assert_eq!(Layout::of_names(&["film.x", "film.y", "R", "G", "B", "lens.u"]), None);
    }

    #[test]
    fn writing_a_dead_block_changes_nothing() {
        let layout = Layout::for_effects(&Effects::default());
        let mut sample = vec![0.0; layout.len()];
        layout.write(&mut sample, Block::Lens, &[1.0, 1.0]);
        assert!(sample.iter().all(|&v| v == 0.0));
        layout.write(&mut sample, Block::Colour, &[1.0, 2.0, 3.0]);
        assert_eq!(sample[layout.colour()], [1.0, 2.0, 3.0]);
    }

    #[test]
    fn each_effect_brings_its_blocks_and_no_others() {
        use Block::*;
        let none = Effects::default();
        for (effects, blocks) in [
            (none, vec![]),
            (Effects { varied_albedo: true, ..none }, vec![Albedo]),
            (Effects { second_hit: true, ..none }, vec![Position2, Normal2, Bsdf1]),
            (Effects { lens: true, ..none }, vec![Lens]),
            (Effects { motion: true, ..none }, vec![Time]),
            (Effects { extended_lights: true, ..none }, vec![Light1]),
            (Effects { visible_emission: true, ..none }, vec![Radiance, Emission]),
        ] {
            let layout = Layout::for_effects(&effects);
            let always = [Film, Colour, Position1, Normal1, Hit];
            let mut end = 0;
            for (block, dims) in ALL {
                let expected = always.contains(&block) || blocks.contains(&block);
                assert_eq!(layout.block(block).is_some(), expected, "{block:?} {effects:?}");
                if let Some(range) = layout.block(block) {
                    assert_eq!(range, end..end + dims.len());
                    assert_eq!(layout.dimensions()[range.clone()], *dims);
                    end = range.end;
                }
            }
            assert_eq!((layout.len(), layout.is_empty()), (end, false));
            assert_eq!((layout.film(), layout.colour()), (0..2, 2..5));
            assert_eq!(layout.radiance(), layout.block(Radiance).unwrap_or(2..5));
        }
        assert_eq!(MAX_DIMENSIONS, 34);
    }
}
