//! What the loop knows, as data: enough to go on in another process as if it had never stopped.
//!
//! Times are no part of it but for the speed of sampling: with a budget of samples nothing else of the
//! past decides, and with one of time the clock starts anew with the program.

use std::sync::Arc;

use super::steps::Grain;
use super::{Batch, ErrorEstimate, Shown};
use crate::adaptive::Allocation;
use crate::image::Planes;
use crate::stats::{Part, Store};

/// What the loop knows between two steps.
#[derive(Clone, Debug)]
pub struct Memory {
    pub store: Arc<Store>,
    pub batches: Vec<Batch>,
    pub estimate: Option<ErrorEstimate>,
    pub rerun: Option<Rerun>,
    /// The batch being rendered; `None` between a batch and the rerun of the filter that follows it.
    pub under_way: Option<UnderWay>,
    /// Samples and seconds of the latest steps.
    pub recent: (f64, f64),
}

/// What is done with a memory: it is kept somewhere.
pub type Keep<'a> = &'a dyn Fn(Memory);

/// A batch of which a share is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct UnderWay {
    pub allocation: Allocation,
    /// In [0, 1].
    pub done: f64,
    pub grain: Grain,
}

/// What a batch's maps are made from: the latest rerun of the filter.
#[derive(Clone, Debug, PartialEq)]
pub struct Rerun {
    /// As in [`crate::filter::Filtered`].
    pub image: Planes,
    pub variance: Planes,
    pub residual: Planes,
    /// As in [`Shown`].
    pub failure: Option<Planes>,
    pub success: Option<f32>,
    /// What the image was made of.
    pub made_of: Snapshot,
    /// Pixels that got samples regardless of their priority since.
    pub probes: Vec<bool>,
}

impl Rerun {
    /// `shown`: what the filter makes of `store`.
    pub(super) fn new(shown: Shown, store: &Store) -> Self {
        let Shown { filtered, failure, success } = shown;
        Self {
            image: filtered.image,
            variance: filtered.variance,
            residual: filtered.residual,
            failure,
            success,
            made_of: Snapshot::of(store),
            probes: vec![false; store.pixels()],
        }
    }
}

/// What the store knew when an image was made of it, by halves.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Radiance: 3 planes each.
    pub mean: [Planes; 2],
    pub count: [Vec<u32>; 2],
}

impl Snapshot {
    pub(super) fn of(store: &Store) -> Self {
        Self {
            mean: [0, 1].map(|h| store.means(Part::Half(h), store.layout().radiance())),
            count: [0, 1].map(|h| store.counts(Part::Half(h))),
        }
    }
}
