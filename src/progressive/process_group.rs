//! What the render loop asks of processes that render one image together.
//!
//! The loop runs in the first of them and decides everything. Each process takes the samples of its own pixels and keeps
//! their statistics; the loop's own store has them after [`ProcessGroup::gather`] only.

use crate::filter::{Denoiser, FilterResult};
use crate::render::RejectedSample;
use crate::stats::{Rectangle, StatisticsExtent, Store};

/// Processes that render one image together.
pub trait ProcessGroup: Send {
    /// Begins a render: gives each process the statistics of its pixels.
    fn begin(&mut self, store: &Store);

    /// Called before every batch with the samples of each pixel in it: the pixels may be divided anew.
    fn begin_batch(&mut self, counts: &[u32]);

    /// Takes `counts[pixel]` more samples of every pixel.
    fn render(&mut self, counts: &[u32]) -> Rendered;

    /// Copies statistics of all pixels to `store`, which has their number and layout. What `extent` lacks stays as it is there.
    fn gather(&mut self, store: &mut Store, extent: StatisticsExtent);

    /// Returns whether all processes can share a filter pass over statistics of which `store` has the counts.
    fn can_share(&self, denoiser: &dyn Denoiser, store: &Store) -> bool;

    /// Filters the statistics of all pixels, with all processes.
    ///
    /// # Panics
    /// If [`Self::can_share`] is false.
    fn filter(&mut self, denoiser: &'static dyn Denoiser) -> FilterResult;

    /// Filters the statistics of a store that the first process has, with all processes.
    ///
    /// # Panics
    /// If [`Self::can_share`] is false.
    fn filter_store(&mut self, denoiser: &'static dyn Denoiser, store: &Store) -> FilterResult;

    /// Returns the number of processes.
    fn count(&self) -> usize;

    /// Prepares memory for a filter pass that all share: this many bytes of a pixel, of its own pixels in each process.
    fn prepare_memory(&mut self, bytes_per_pixel: usize);

    /// Returns what each process has done so far, the first one first.
    fn records(&mut self) -> Vec<ProcessRecord>;
}

/// Filters a store that this process has, with all processes if there are several that can share the work.
pub fn filter_together(
    processes: Option<&mut (dyn ProcessGroup + '_)>,
    denoiser: &'static dyn Denoiser,
    store: &Store,
    seed: u64,
) -> FilterResult {
    match processes {
        Some(processes) if processes.can_share(denoiser, store) => processes.filter_store(denoiser, store),
        _ => denoiser.filter(store, seed),
    }
}

/// What has come of some samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rendered {
    /// Samples of all pixels so far.
    pub samples: SampleTotals,
    /// The first sample of this step that was rejected.
    pub first_rejected: Option<RejectedSample>,
}

/// Numbers of samples of all pixels, and of pixels without samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SampleTotals {
    /// Rejected ones included.
    pub taken: u64,
    pub valid: u64,
    pub empty_pixels: u64,
}

impl SampleTotals {
    /// Counts the samples of a store.
    pub fn new(store: &Store) -> Self {
        Self {
            taken: store.samples_taken(),
            valid: store.samples(),
            empty_pixels: store.empty_pixels(&Rectangle::whole(store.width(), store.height())) as u64,
        }
    }
}

impl std::ops::AddAssign for SampleTotals {
    fn add_assign(&mut self, other: Self) {
        self.taken += other.taken;
        self.valid += other.valid;
        self.empty_pixels += other.empty_pixels;
    }
}

/// What a process of a group has done.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ProcessRecord {
    /// Name of its machine.
    pub host: String,
    pub threads: usize,
    /// Its pixels at the end.
    pub pixels: usize,
    /// Seconds in which it took samples, and in which it filtered with others.
    pub render: f64,
    pub filter: f64,
    /// Seconds in which it sent and received, and in which it waited for other processes to do so.
    pub transfer: f64,
    pub bytes_sent: u64,
    pub peak_memory_bytes: Option<u64>,
}
