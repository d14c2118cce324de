//! Whether a render can go on from a state.

use super::image_metadata::ImageMetadata;
use super::render_state::RenderState;
use super::stream::Stream;
use crate::filter::MissingData;
use crate::progressive::{RecordedStatistics, Settings};
use crate::stats::{BlockSet, Layout};

/// The first thing in which a state and a render differ.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: found a state of {found}; accepted is {accepted}")]
pub struct ResumeError {
    pub field: &'static str,
    pub found: String,
    pub accepted: String,
}

impl RenderState {
    /// Checks that a render of the image `metadata`, the samples `stream` and the scene's dimensions `layout`, of which it
    /// keeps what the state has, can go on from this state. `asked` are the blocks of dimensions that a user asked for, beside what the
    /// settings call for.
    ///
    /// # Errors
    /// A state of another image, of other samples or dimensions, or with less than the denoiser reads or was asked for.
    pub fn can_resume(
        &self,
        metadata: &ImageMetadata,
        stream: Stream,
        layout: &Layout,
        settings: &Settings,
        asked: BlockSet,
    ) -> Result<(), ResumeError> {
        let differ = |field, found: String, accepted: String| Err(ResumeError { field, found, accepted });
        if let Some((field, found, accepted)) = metadata.difference(&self.metadata) {
            return differ(field, found, format!("one of this render, {accepted}"));
        }
        if self.streams != [stream] {
            let found: Vec<String> = self.streams.iter().map(Stream::to_string).collect();
            return differ("seed and shard", found.join(" and "), format!("one of {stream}"));
        }
        let store = &self.checkpoint.store;
        let names = |layout: &Layout| layout.names().collect::<Vec<_>>().join(" ");
        let accepted = layout.restricted_to(store.layout().blocks());
        if *store.layout() != accepted {
            return differ("layout", names(store.layout()), names(&accepted));
        }
        let (found, needed) = (store.capacity(), settings.reservoir_capacity());
        if found < needed {
            let accepted =
                format!("at least the {needed} that the denoiser or the setting `reservoir` asks for");
            return differ("reservoir", format!("{found} sample vectors per pixel"), accepted);
        }
        let kept = names(store.layout());
        if let Err(MissingData::Statistics { names, denoiser }) =
            MissingData::check_layout(store.layout(), settings.denoiser)
        {
            let accepted = format!(
                "one with those of {}, which {denoiser} reads: --statistics all keeps them",
                names.join(" ")
            );
            return differ("statistics", kept, accepted);
        }
        let keeps_all = settings.statistics == RecordedStatistics::All;
        let wanted = layout.restricted_to(if keeps_all { BlockSet::ALL } else { asked });
        let lacking: Vec<_> =
            wanted.names().filter(|name| store.layout().names().all(|kept| kept != *name)).collect();
        if !lacking.is_empty() {
            let accepted = format!("one with those of {}, which were asked for", lacking.join(" "));
            return differ("statistics", kept, accepted);
        }
        Ok(())
    }
}
