//! How long what comes after the last batch will take: measured, by doing it on some rows of the
//! image.
//!
//! The cost of a filter and of an encoder follows from the machine, from what else runs on it, and
//! from the layout, all of which the rows share with the image.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use super::Closing;
use crate::filter::Filtered;
use crate::stats::Store;

/// Bands of rows, evenly spread over the image.
const BANDS: usize = 4;
/// Share of the image's rows that is taken.
const SHARE_OF_ROWS: usize = 8;
/// Rows of a band at least: fewer are mostly borders.
const LEAST_ROWS: usize = 12;
/// Share of the time that rehearsals may take.
const SHARE_OF_TIME: f64 = 0.06;
/// The whole takes longer than its rows say (measured: 0 to 18 %, the more the larger the image): less of it is in the
/// cache, and it needs a disk. The budget's margin has to cover what this leaves.
const WHOLE_EXCESS: f64 = 1.06;
/// Memory is made ready in pieces of so many bytes.
const PIECE: usize = 8 << 20;
/// A rehearsal must be followed by more than this many times its time for samples.
const LEAST_USE: f64 = 2.0;
/// The first rehearsal takes about so many times as long as the others will: memory is made ready before it.
const FIRST_EXCESS: f64 = 2.0;
/// When no more than this many times what is rehearsed is left for samples, one more is due: the
/// machine may be busier than it was.
const LAST_LOOK: f64 = 1.0;

/// The latest rehearsal, scaled to the whole image.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rehearsal {
    /// Seconds of a filter pass of the final quality.
    pub filter_seconds: f64,
    /// Seconds of that and of what the caller does.
    pub closing_seconds: f64,
    /// Seconds of all rehearsals so far.
    spent: f64,
    /// Seconds of the latest one.
    latest: Option<f64>,
    /// Whether the last look was taken.
    looked: bool,
}

impl Rehearsal {
    /// A pass of the final quality was made of the whole image in so many seconds. How much less than predicted
    /// the next one will take.
    pub fn corrected_by_pass(&mut self, seconds: f64) -> f64 {
        std::mem::replace(&mut self.filter_seconds, seconds) - seconds
    }

    /// Whether it is time for another one, with so many seconds `left` for samples and so many predicted
    /// for `closing`.
    pub fn is_due(&self, elapsed: f64, left: f64, closing: f64) -> bool {
        let next = self.latest.unwrap_or(FIRST_EXCESS * closing / SHARE_OF_ROWS as f64);
        let affordable = self.latest.is_none() || self.spent + next <= SHARE_OF_TIME * elapsed;
        left > LEAST_USE * next && (affordable || self.is_last_look(left))
    }

    /// Whether there was none so far.
    pub fn is_missing(&self) -> bool {
        self.latest.is_none()
    }

    /// Whether it is the last time to see how busy the machine is.
    fn is_last_look(&self, left: f64) -> bool {
        !self.looked && left <= LAST_LOOK * self.closing_seconds
    }

    /// Whether the only one so far has to be done again at once, with so many seconds `left` by it: by one
    /// that takes too long there is hardly any time left.
    pub fn is_doubtful(&self, left: f64) -> bool {
        self.latest == Some(self.spent) && self.is_last_look(left)
    }

    /// `left`: as in [`Self::is_due`].
    pub fn run(
        &mut self,
        store: &Store,
        left: f64,
        filter: impl Fn(&Store) -> Filtered,
        closing: Option<Closing>,
    ) {
        self.looked |= left <= LAST_LOOK * self.closing_seconds;
        let started = Instant::now();
        let rows = store.of_rows(rows(store.height()));
        let scale = WHOLE_EXCESS * store.pixels() as f64 / rows.pixels().max(1) as f64;
        let filtering = Instant::now();
        let filtered = filter(&rows);
        self.filter_seconds = scale * filtering.elapsed().as_secs_f64();
        if let Some(closing) = closing {
            closing(&filtered, &rows);
        }
        self.closing_seconds = scale * filtering.elapsed().as_secs_f64();
        let seconds = started.elapsed().as_secs_f64();
        self.spent += seconds;
        self.latest = Some(seconds);
    }
}

/// Takes so many bytes from the system before they are needed, once in a process. The allocator keeps them (see
/// `main`), so that what uses them later takes as long as a rehearsal says: where memory is dear (a virtual machine),
/// new pages are most of a first pass.
pub(super) fn make_ready(bytes: usize) {
    static READY: AtomicUsize = AtomicUsize::new(0);
    let missing = bytes.saturating_sub(READY.fetch_max(bytes, Ordering::Relaxed));
    // What is not zero has to be written, page by page.
    let pieces: Vec<_> = (0..missing / PIECE).into_par_iter().map(|_| vec![1u8; PIECE]).collect();
    std::hint::black_box(pieces);
}

/// The rows that stand for an image of so many.
fn rows(height: usize) -> Vec<usize> {
    let rows = (height / (SHARE_OF_ROWS * BANDS)).max(LEAST_ROWS);
    if rows * BANDS >= height {
        return (0..height).collect();
    }
    let band = height / BANDS;
    (0..BANDS).flat_map(|i| (0..rows).map(move |y| i * band + (band - rows) / 2 + y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_eighth_of_a_large_image_and_all_of_a_small_one_are_rehearsed() {
        let of_large = rows(512);
        assert_eq!(of_large.len(), 64);
        assert!(of_large.is_sorted() && of_large[0] > 0 && of_large[63] < 511);
        assert_eq!(rows(40), (0..40).collect::<Vec<_>>());
        assert!(rows(0).is_empty());
    }

    #[test]
    fn rehearsals_take_their_share_of_the_time_and_no_more() {
        let once = Rehearsal { spent: 0.1, latest: Some(0.1), ..Rehearsal::default() };
        let due = |elapsed, left| once.is_due(elapsed, left, 0.8);
        assert!(!due(3.0, 9.0) && due(4.0, 9.0) && !due(4.0, 0.1));
    }

    #[test]
    fn the_first_rehearsal_comes_whatever_its_share_if_enough_is_left_to_be_of_use() {
        let none = Rehearsal::default();
        // It would take 2 ∕ 8 of 0.8 seconds.
        assert!(none.is_due(0.0, 0.41, 0.8) && !none.is_due(9.0, 0.39, 0.8));
    }

    #[test]
    fn a_whole_pass_replaces_what_its_rows_said() {
        let mut rehearsal = Rehearsal { filter_seconds: 1.0, ..Rehearsal::default() };
        assert!((rehearsal.corrected_by_pass(1.2) + 0.2).abs() < 1e-9);
        assert!((rehearsal.corrected_by_pass(0.9) - 0.3).abs() < 1e-9);
    }

    #[test]
    fn one_more_rehearsal_comes_before_the_end() {
        let once = Rehearsal { spent: 0.1, latest: Some(0.1), closing_seconds: 0.8, ..Rehearsal::default() };
        assert!(!once.is_due(2.5, 1.0, 0.8) && once.is_due(2.6, 0.7, 0.8));
        assert!(!once.is_doubtful(1.0) && once.is_doubtful(-3.0), "the first one may be far off");
        assert!(!Rehearsal { spent: 0.3, ..once }.is_doubtful(-3.0));
        assert!(!Rehearsal { looked: true, ..once }.is_due(2.6, 0.7, 0.8));
    }
}
