//! What the driver of a render loop asks of the program around it: progress, filter passes, interruption, checkpoints.

use std::sync::Arc;

use super::checkpoint::Checkpoint;
use super::filter_pass::Filtered;
use super::record::Progress;
use super::settings::Settings;
use crate::filter::FilterResult;
use crate::render::SampleSink;
use crate::stats::Store;

/// The program around a render loop. All methods have defaults: `()` is a host.
pub trait Host {
    /// Called after every step.
    fn listen(&mut self, _progress: &Progress) {}

    /// Called after every filter pass, the last one included, with its result and the store that it filtered.
    fn complete_pass(&mut self, _filtered: &Filtered, _store: &Arc<Store>) {}

    /// Called before every batch. Returns the samples of each pixel in it; `planned` are those that settings and maps give, by
    /// default taken as they are. Other counts must not be all zero, and not sum to more.
    fn choose_counts(&mut self, _store: &Arc<Store>, planned: Vec<u32>) -> Vec<u32> {
        planned
    }

    /// Returns whether the render should end soon.
    fn is_interrupted(&self) -> bool {
        false
    }

    /// Encodes the image and checkpoint of some rows as at the end of the render, and discards the result: the loop times
    /// this call.
    fn encode_and_discard(&self, _settings: &Settings, _rows_result: &FilterResult, _rows: &Store) {}

    /// Returns the seconds between two checkpoints; `None` if none are kept.
    fn checkpoint_interval(&self) -> Option<f64> {
        None
    }

    /// Returns where the records of all samples go; `None` if nobody wants them.
    fn sample_sink(&mut self) -> Option<&mut dyn SampleSink> {
        None
    }

    /// Keeps a checkpoint.
    fn save(&mut self, _settings: &Settings, _checkpoint: Checkpoint) {}
}

impl Host for () {}
