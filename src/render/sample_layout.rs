//! Chooses the dimensions of the sample vector by the effects in a scene.

use crate::scene::Effects;
use crate::stats::{Block, Layout};

/// The layout that a scene with these effects needs: 27 dimensions and the auxiliary ones if it has all
/// effects.
pub fn sample_layout(effects: &Effects) -> Layout {
    Layout::with_blocks(|block| match block {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_without_effects_has_no_random_dimension() {
        let layout = sample_layout(&Effects::default());
        assert!(layout.randoms().is_empty());
        assert_eq!(layout.features().len(), 6);
        assert_eq!(layout.radiance(), layout.colour());
        assert_eq!(layout.block(Block::Lens), None);
    }

    #[test]
    fn each_effect_enables_its_blocks_and_no_others() {
        use Block::*;
        const ALL: [Block; 14] = [
            Film, Colour, Position1, Normal1, Albedo, Position2, Normal2, Lens, Time, Light1, Bsdf1,
            Radiance, Emission, Hit,
        ];
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
            let layout = sample_layout(&effects);
            let always = [Film, Colour, Position1, Normal1, Hit];
            for block in ALL {
                let expected = always.contains(&block) || blocks.contains(&block);
                assert_eq!(layout.block(block).is_some(), expected, "{block:?} {effects:?}");
            }
        }
    }
}
