//! Resolves mixes of materials by stochastic choice (pbrt-v4's `MixMaterial`, section 10.5.1).

use crate::scene::{FloatTextureId, Material, MaterialId, MaterialKind};

/// Mixes nested deeper than this are taken for a cycle.
const MAX_MIX_DEPTH: usize = 64;

/// Chooses one material of nested mixes by `u` in [0, 1), which each choice rescales to [0, 1) for the next.
/// `None` if the mixes refer to each other in a cycle.
pub(super) fn choose_material(
    materials: &[Material],
    mut id: MaterialId,
    mut u: f32,
    amount_at_point: impl Fn(FloatTextureId) -> f32,
) -> Option<&Material> {
    for _ in 0..MAX_MIX_DEPTH {
        let material = &materials[id.0 as usize];
        let MaterialKind::Mix { first, second, amount } = material.kind else { return Some(material) };
        let amount = amount_at_point(amount);
        if u < amount {
            (id, u) = (second, u / amount.min(1.0));
        } else {
            let amount = amount.max(0.0);
            (id, u) = (first, (u - amount) / (1.0 - amount));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(kind: MaterialKind) -> Material {
        Material { name: String::new(), kind, displacement: None, normal_map: None }
    }

    fn mix(first: u32, second: u32, amount: u32) -> Material {
        let (first, second, amount) = (MaterialId(first), MaterialId(second), FloatTextureId(amount));
        material(MaterialKind::Mix { first, second, amount })
    }

    fn glass(eta: f32) -> Material {
        material(MaterialKind::ThinDielectric { eta })
    }

    fn eta(material: Option<&Material>) -> f32 {
        match material.map(|m| &m.kind) {
            Some(MaterialKind::ThinDielectric { eta }) => *eta,
            other => panic!("not one of the test's materials: {other:?}"),
        }
    }

    #[test]
    fn a_mix_of_mixes_chooses_each_material_with_its_fraction() {
        // A quarter of 3; of the rest, half each of 1 and 2.
        let materials = [mix(1, 4, 0), mix(2, 3, 1), glass(1.0), glass(2.0), glass(3.0)];
        let amount = |id: FloatTextureId| [0.25, 0.5][id.0 as usize];
        let mut counts = [0; 4];
        for i in 0..1000 {
            let u = (i as f32 + 0.5) / 1000.0;
            counts[eta(choose_material(&materials, MaterialId(0), u, amount)) as usize] += 1;
        }
        assert!((counts[3] - 250i32).abs() <= 1 && (counts[1] - 375i32).abs() <= 1, "{counts:?}");
    }

    #[test]
    fn amounts_beyond_their_range_choose_one_material() {
        let materials = [mix(1, 2, 0), glass(1.0), glass(2.0)];
        for (amount, expected) in [(-1.0, 1.0), (0.0, 1.0), (f32::NAN, 1.0), (1.0, 2.0), (7.0, 2.0)] {
            for u in [0.0, 0.5, 1.0 - f32::EPSILON] {
                assert_eq!(eta(choose_material(&materials, MaterialId(0), u, |_| amount)), expected);
            }
        }
    }

    #[test]
    fn cyclic_mixes_choose_no_material() {
        let materials = [mix(1, 1, 0), mix(0, 0, 0)];
        assert!(choose_material(&materials, MaterialId(0), 0.3, |_| 0.5).is_none());
    }
}
