//! The dimensions that a sample can have, in blocks that are enabled or disabled as a whole.

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
pub(super) const BLOCKS: [(Block, &[Dimension]); 14] = {
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
    BLOCKS.iter().map(|(_, dimensions)| dimensions.iter().map(|dimension| dimension.name).collect())
}

/// Number of dimensions of a sample with all blocks enabled.
pub const MAX_DIMENSIONS: usize = {
    let (mut sum, mut i) = (0, 0);
    while i < BLOCKS.len() {
        sum += BLOCKS[i].1.len();
        i += 1;
    }
    sum
};
