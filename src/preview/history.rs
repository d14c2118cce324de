//! The renders that commands have replaced, for undo and redo, as far as memory allows.
//!
//! A command that discards the samples puts the render so far here, and the page can have it back: the samples, the camera
//! and the settings. Where there are too many, those of the least time go first: they are rendered again soonest. The latest goes last, since
//! an undo leads there.

use super::generation_record::GenerationRecord;
use super::orbit_camera::OrbitCamera;
use crate::memory::available_bytes;
use crate::progressive::{Checkpoint, Settings};
use crate::stats::Store;

/// Most renders that are kept.
pub const MOST_KEPT: usize = 8;
/// Largest fraction that they may take of the memory that would be free without them.
const MEMORY_FRACTION: f64 = 0.125;
/// Bytes per pixel of a render beside its store: images and maps of its passes.
const BYTES_BESIDE: usize = 120;
/// Shortest time of a render that is kept, in seconds; a movement of the camera passes through many shorter ones.
const SHORTEST: f64 = 2.0;

/// A render that can go on.
pub struct KeptRender {
    pub camera: Option<OrbitCamera>,
    pub settings: Settings,
    pub checkpoint: Checkpoint,
    pub record: GenerationRecord,
    /// Whether its checkpoints go to the state file.
    pub keeps_checkpoints: bool,
    /// Whether it is kept however short it was.
    pub is_kept_if_short: bool,
}

/// A way through the history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HistoryStep {
    Undo,
    Redo,
}

/// The kept renders; see the module.
#[derive(Default)]
pub struct History {
    /// Before the current render, the latest last.
    done: Vec<KeptRender>,
    /// After it, the next last.
    undone: Vec<KeptRender>,
}

impl KeptRender {
    /// Returns whether it is worth keeping.
    pub fn is_worth_it(&self) -> bool {
        self.is_kept_if_short || self.seconds() >= SHORTEST
    }

    /// Returns the seconds of its render.
    pub fn seconds(&self) -> f64 {
        self.record.progress.map_or(0.0, |progress| progress.elapsed)
    }

    pub fn bytes(&self) -> f64 {
        bytes(&self.checkpoint.store)
    }

    /// Describes it in a few words.
    pub fn description(&self) -> String {
        let store = &self.checkpoint.store;
        let spp = store.spp();
        format!("{spp:.1} samples per pixel by {}", self.settings.denoiser.name())
    }
}

/// Returns the bytes of a kept render with this store.
fn bytes(store: &Store) -> f64 {
    let beside = BYTES_BESIDE + Store::bytes_per_pixel(store.layout(), 0);
    (beside * store.pixels()) as f64 + store.reservoir_bytes() as f64
}

impl History {
    /// Returns the bytes of the kept renders.
    pub fn bytes(&self) -> f64 {
        self.done.iter().chain(&self.undone).map(KeptRender::bytes).sum()
    }

    /// Returns whether a render with this store could be kept, if nothing else were.
    pub fn has_room(&self, store: &Store) -> bool {
        available_bytes().is_none_or(|available| {
            // The store is part of what is taken already.
            bytes(store) <= MEMORY_FRACTION * (available + self.bytes() + bytes(store))
        })
    }

    /// Returns the bytes that kept renders may take; `None` if the system does not tell what is free.
    pub fn byte_limit(&self) -> Option<f64> {
        available_bytes().map(|available| MEMORY_FRACTION * (available + self.bytes()))
    }

    /// Keeps a render that another one replaces, if it is worth it and there is room. Returns the renders that are not kept
    /// any longer.
    pub fn keep(&mut self, render: KeptRender) -> Vec<KeptRender> {
        // What was undone stays reachable: it moves before the render.
        let undone = std::mem::take(&mut self.undone);
        self.done.splice(0..0, undone);
        if !render.is_worth_it() {
            return vec![render];
        }
        self.done.push(render);
        self.make_room(self.byte_limit())
    }

    /// Removes renders until the others take no more than `limit` bytes, and returns them.
    fn make_room(&mut self, limit: Option<f64>) -> Vec<KeptRender> {
        let is_full = |kept: &[KeptRender]| {
            let bytes = kept.iter().map(KeptRender::bytes).sum::<f64>();
            kept.len() > MOST_KEPT || limit.is_some_and(|limit| bytes > limit)
        };
        let mut removed = Vec::new();
        if self.done.last().is_some_and(|latest| is_full(std::slice::from_ref(latest))) {
            // One that is larger than the limit by itself is dropped alone
            removed.extend(self.done.pop());
        }
        while is_full(&self.done) {
            let seconds = |&i: &usize| self.done[i].seconds();
            let earlier = 0..self.done.len() - 1;
            let shortest = earlier.min_by(|a, b| seconds(a).total_cmp(&seconds(b))).unwrap_or(0);
            removed.push(self.done.remove(shortest));
        }
        removed
    }

    /// Returns whether there is a render that way.
    pub fn leads(&self, step: HistoryStep) -> bool {
        match step {
            HistoryStep::Undo => !self.done.is_empty(),
            HistoryStep::Redo => !self.undone.is_empty(),
        }
    }

    /// Exchanges the current render for the next one that way; returns it again if there is none.
    pub fn exchange(&mut self, step: HistoryStep, current: KeptRender) -> KeptRender {
        let (from, to) = match step {
            HistoryStep::Undo => (&mut self.done, &mut self.undone),
            HistoryStep::Redo => (&mut self.undone, &mut self.done),
        };
        let Some(next) = from.pop() else { return current };
        if current.is_worth_it() {
            to.push(current);
        }
        next
    }

    /// Returns the description of the render that way.
    pub fn description(&self, step: HistoryStep) -> Option<String> {
        let list = if step == HistoryStep::Undo { &self.done } else { &self.undone };
        list.last().map(KeptRender::description)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progressive::Progress;
    use crate::stats::Layout;

    /// A finished render of `seconds` seconds whose image is `width` pixels wide.
    fn finished_after(seconds: f64, width: usize) -> KeptRender {
        let store = Store::new(width, 16, Layout::with_blocks(|_| false), 0, 0);
        let progress = Progress { fraction: 1.0, elapsed: seconds, samples: 1, spp: 1.0, estimate: None };
        KeptRender {
            camera: None,
            settings: Settings::default(),
            checkpoint: Checkpoint::new(store),
            record: GenerationRecord { progress: Some(progress), ..GenerationRecord::default() },
            keeps_checkpoints: false,
            is_kept_if_short: true,
        }
    }

    fn finished(width: usize) -> KeptRender {
        finished_after(5.0, width)
    }

    fn widths(kept: &[KeptRender]) -> Vec<usize> {
        kept.iter().map(|kept| kept.checkpoint.store.width()).collect()
    }

    #[test]
    fn of_equally_long_renders_the_oldest_go_first() {
        let mut history = History::default();
        for width in 1..=MOST_KEPT {
            assert!(history.keep(finished(width)).is_empty());
        }
        assert_eq!(widths(&history.keep(finished(MOST_KEPT + 1))), [1], "more than are kept");
        let limit = history.done[5..].iter().map(KeptRender::bytes).sum();
        assert_eq!(widths(&history.make_room(Some(limit))), [2, 3, 4, 5, 6], "more bytes than may be taken");
        assert_eq!(widths(&history.done), [7, 8, 9]);
        assert_eq!(widths(&history.make_room(Some(0.0))), [9, 7, 8]);
    }

    #[test]
    fn a_long_render_outlasts_glances_at_other_views() {
        let mut history = History::default();
        history.keep(finished_after(600.0, 1));
        (2..=MOST_KEPT).for_each(|width| drop(history.keep(finished_after(3.0, width))));
        assert_eq!(widths(&history.keep(finished_after(2.0, MOST_KEPT + 1))), [2]);
        assert_eq!(widths(&history.done)[0], 1);
        let least = history.done.last().map(KeptRender::bytes);
        assert_eq!(history.make_room(least).len(), MOST_KEPT - 1, "the latest is kept, short as it is");
        assert_eq!(widths(&history.done), [MOST_KEPT + 1]);

        // One without room is dropped alone
        let limit = least.map(|bytes| bytes - 1.0);
        let mut history = History::default();
        [finished(1), finished(MOST_KEPT + 1)].into_iter().for_each(|render| history.done.push(render));
        assert_eq!(widths(&history.make_room(limit)), [MOST_KEPT + 1]);
        assert_eq!(widths(&history.done), [1]);
    }

    #[test]
    fn what_was_undone_is_older_than_what_replaces_it() {
        let mut history = History::default();
        history.keep(finished(1));
        history.keep(finished(2));
        let current = history.exchange(HistoryStep::Undo, finished(3));
        assert!(history.keep(current).is_empty());
        assert_eq!(widths(&history.done), [3, 1, 2]);
    }

    #[test]
    fn short_renders_are_not_kept() {
        let mut history = History::default();
        let short = KeptRender { is_kept_if_short: false, ..finished_after(1.0, 1) };
        assert_eq!(history.keep(short).len(), 1);
        assert!(!history.leads(HistoryStep::Undo));
    }
}
