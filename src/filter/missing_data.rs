//! Checks that a store has what a denoiser reads.

use super::denoiser::{Denoiser, SampleVectors};
use super::denoiser_name::DenoiserName;
use crate::stats::{Block, Layout, Part, Store};

/// The data that a denoiser reads and a store lacks. The messages name the options of `prpf render` that would have kept it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MissingData {
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

impl MissingData {
    /// Checks the statistics and the sample vectors of a store.
    ///
    /// # Errors
    /// What is missing.
    pub fn check(store: &Store, denoiser: &dyn Denoiser) -> Result<(), Self> {
        let needed = match denoiser.reads().sample_vectors {
            SampleVectors::None => 0,
            SampleVectors::Reservoir(size) => size,
            SampleVectors::All { .. } => store.counts(Part::Whole).into_iter().max().unwrap_or(0) as usize,
        };
        let found = store.capacity();
        if found < needed {
            return Err(Self::SampleVectors { denoiser: denoiser.name(), found, needed });
        }
        Self::check_layout(store.layout(), denoiser)
    }

    /// Checks that stores of a layout have all statistics that the denoiser reads and the scene calls for.
    ///
    /// # Errors
    /// Those that are missing.
    pub fn check_layout(layout: &Layout, denoiser: &dyn Denoiser) -> Result<(), Self> {
        let reads_all = denoiser.reads().sample_vectors != SampleVectors::None;
        let is_read = |block: &Block| reads_all || denoiser.reads().blocks.contains(block);
        let names = layout.names_left_out(is_read);
        if names.is_empty() { Ok(()) } else { Err(Self::Statistics { denoiser: denoiser.name(), names }) }
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
        let check = |store: &Store, method| MissingData::check(store, find(method, None).unwrap());
        let message = |store: &Store, method| check(store, method).unwrap_err().to_string();
        assert_eq!(check(&store, "nlm"), Ok(()));
        assert_eq!(check(&store, "none"), Ok(()));
        let learned = message(&store, "learned");
        assert!(learned.contains("P1.x P1.y P1.z N2.x") && !learned.contains("hit"), "{learned}");
        assert!(learned.contains("--denoiser learned or with --statistics all"), "{learned}");
        assert!(message(&store, "prpf").contains("--reservoir 8"));
        let vectors = Store::new(2, 2, whole.restricted_to(kept), 8, 0);
        let pixelwise = message(&vectors, "prpf");
        assert!(pixelwise.contains("film.x") && pixelwise.contains("lens.u"), "{pixelwise}");
        assert_eq!(check(&Store::new(2, 2, whole, 8, 0), "prpf"), Ok(()));
    }
}
