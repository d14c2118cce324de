//! What a store lacks for a denoiser.

use super::denoiser::{Denoiser, SampleVectors};
use super::denoiser_name::DenoiserName;
use crate::stats::{Block, Layout, Part, Store};

/// What a store lacks. The messages name the options of `prpf render` that would have kept it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Lack {
    #[error(
        "found a reservoir of {found} sample vectors per pixel, and {denoiser} needs {needed}; accepted is a reservoir \
         of {needed} (--reservoir {needed}), or the denoiser nlm"
    )]
    SampleVectors { denoiser: DenoiserName, found: usize, needed: usize },
    #[error(
        "found no statistics of {}, which {denoiser} reads; accepted are those of a render with --denoiser {} or with \
         --statistics all", names.join(" "), denoiser.method
    )]
    Statistics { denoiser: DenoiserName, names: Vec<&'static str> },
}

impl Lack {
    /// Returns what a store lacks of the data that a denoiser reads; `None` if it can be filtered.
    pub fn of(store: &Store, denoiser: &dyn Denoiser) -> Option<Self> {
        let needed = match denoiser.reads().sample_vectors {
            SampleVectors::None => 0,
            SampleVectors::Reservoir(size) => size,
            SampleVectors::All { .. } => store.counts(Part::Whole).into_iter().max().unwrap_or(0) as usize,
        };
        let found = store.capacity();
        if found < needed {
            return Some(Self::SampleVectors { denoiser: denoiser.name(), found, needed });
        }
        Self::of_layout(store.layout(), denoiser)
    }

    /// Returns the statistics that stores of a layout lack for a denoiser; `None` if they have all that the scene calls for.
    pub fn of_layout(layout: &Layout, denoiser: &dyn Denoiser) -> Option<Self> {
        let reads_all = denoiser.reads().sample_vectors != SampleVectors::None;
        let is_read = |block: &Block| reads_all || denoiser.reads().blocks.contains(block);
        let names = layout.names_left_out(is_read);
        (!names.is_empty()).then(|| Self::Statistics { denoiser: denoiser.name(), names })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::find;
    use crate::stats::BlockSet;

    #[test]
    fn what_a_denoiser_does_not_find_is_named() {
        let whole = Layout::with_blocks(|block| block != Block::Hit);
        let kept: BlockSet =
            [Block::Normal1, Block::Albedo, Block::Emission, Block::Radiance].into_iter().collect();
        let store = Store::new(2, 2, whole.restricted_to(kept), 0, 0);
        let lack = |method| Lack::of(&store, find(method, None).unwrap()).map(|lack| lack.to_string());
        assert_eq!(lack("nlm"), None);
        assert_eq!(lack("none"), None);
        let learned = lack("learned").unwrap();
        assert!(learned.contains("P1.x P1.y P1.z N2.x") && !learned.contains("hit"), "{learned}");
        assert!(learned.contains("--denoiser learned or with --statistics all"), "{learned}");
        assert!(lack("prpf").unwrap().contains("--reservoir 8"));
        let vectors = Store::new(2, 2, whole.restricted_to(kept), 8, 0);
        let lack = Lack::of(&vectors, find("prpf", None).unwrap()).unwrap().to_string();
        assert!(lack.contains("film.x") && lack.contains("lens.u"), "{lack}");
        assert_eq!(Lack::of(&Store::new(2, 2, whole, 8, 0), find("prpf", None).unwrap()), None);
    }
}
