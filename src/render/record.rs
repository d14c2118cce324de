//! What is remembered of one path: all that a sample vector can hold.

use glam::{Vec2, Vec3};

use crate::stats::{Layout, MAX_DIMENSIONS};

/// Everything that the blocks of a [`Layout`] ask for.
#[derive(Clone, Copy, Debug, Default)]
pub struct Record {
    /// In pixels of the whole image.
    pub film: Vec2,
    /// Radiance without directly visible emission.
    pub colour: Vec3,
    /// Emission seen by the camera, directly or by way of perfectly specular surfaces only.
    pub visible: Vec3,
    /// Positions are in scene diameters.
    pub position1: Vec3,
    pub normal1: Vec3,
    pub albedo: Vec3,
    pub position2: Vec3,
    pub normal2: Vec3,
    /// Numbers in [0, 1).
    pub lens: Vec2,
    pub time: f32,
    pub light1: Vec2,
    pub bsdf1: Vec2,
    /// The camera ray met a surface.
    pub hit: bool,
}

impl Record {
    /// The sample vector of a layout in which everything is alive; `exposure` is the factor from
    /// radiance to pixel value.
    #[inline]
    pub fn values(&self, exposure: f32) -> [f32; MAX_DIMENSIONS] {
        let [film, lens, light1, bsdf1] = [self.film, self.lens, self.light1, self.bsdf1];
        let (colour, visible) = (exposure * self.colour, exposure * self.visible);
        let [c, p1, n1, a] = [colour, self.position1, self.normal1, self.albedo];
        let [p2, n2, e, r] = [self.position2, self.normal2, visible, colour + visible];
        let hit = if self.hit { 1.0 } else { 0.0 };
        [
            film.x, film.y, c.x, c.y, c.z, p1.x, p1.y, p1.z, n1.x, n1.y, n1.z, a.x, a.y, a.z, p2.x, p2.y,
            p2.z, n2.x, n2.y, n2.z, lens.x, lens.y, self.time, light1.x, light1.y, bsdf1.x, bsdf1.y, r.x,
            r.y, r.z, e.x, e.y, e.z, hit,
        ]
    }

    /// For each dimension of a layout, its place in [`Self::values`].
    pub fn alive(layout: &Layout) -> Vec<usize> {
        let all = Layout::with_blocks(|_| true);
        let place = |name| all.dimensions().iter().position(|d| d.name == name);
        let dimensions = layout.dimensions().iter();
        dimensions.map(|d| place(d.name).expect("a layout with every block has every dimension")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Block;

    #[test]
    fn values_stand_where_the_layout_has_them() {
        let record = Record {
            film: Vec2::new(1.0, 2.0),
            colour: Vec3::new(3.0, 4.0, 5.0),
            visible: Vec3::splat(10.0),
            position1: Vec3::splat(6.0),
            normal1: Vec3::splat(7.0),
            albedo: Vec3::splat(8.0),
            position2: Vec3::splat(9.0),
            normal2: Vec3::splat(10.0),
            lens: Vec2::splat(11.0),
            time: 12.0,
            light1: Vec2::splat(13.0),
            bsdf1: Vec2::new(14.0, 15.0),
            hit: true,
        };
        let layout = Layout::with_blocks(|_| true);
        let values = record.values(1.0);
        assert_eq!(layout.len(), values.len());
        let expected: [(Block, &[f32]); 14] = [
            (Block::Film, &[1.0, 2.0]),
            (Block::Colour, &[3.0, 4.0, 5.0]),
            (Block::Position1, &[6.0; 3]),
            (Block::Normal1, &[7.0; 3]),
            (Block::Albedo, &[8.0; 3]),
            (Block::Position2, &[9.0; 3]),
            (Block::Normal2, &[10.0; 3]),
            (Block::Lens, &[11.0; 2]),
            (Block::Time, &[12.0]),
            (Block::Light1, &[13.0; 2]),
            (Block::Bsdf1, &[14.0, 15.0]),
            (Block::Radiance, &[13.0, 14.0, 15.0]),
            (Block::Emission, &[10.0; 3]),
            (Block::Hit, &[1.0]),
        ];
        for (block, expected) in expected {
            assert_eq!(values[layout.block(block).unwrap()], *expected, "{block:?}");
        }
    }

    #[test]
    fn dead_dimensions_are_left_out() {
        let layout = Layout::with_blocks(|block| block == Block::Hit);
        assert_eq!(Record::alive(&layout), [0, 1, 2, 3, 4, 33]);
    }
}
