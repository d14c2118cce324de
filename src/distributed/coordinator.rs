//! The process group as the render loop sees it: commands the other processes, and renders pixels of its own.
//!
//! Pixels are divided by what a sample of each tile is expected to cost. After every batch the costs of a process's tiles
//! are multiplied by the ratio of the seconds that it took to those that were expected.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::command::{Answer, Command, encode_counts};
use super::exchange::StoreKind;
use super::link::Link;
use super::partition::TileCosts;
use super::worker::OwnPart;
use crate::filter::{Denoiser, FilterResult};
use crate::memory;
use crate::progressive::{ProcessGroup, ProcessRecord, Rendered, SampleTotals};
use crate::render::{RejectedSample, Renderer};
use crate::stats::{Part, Rectangle, StatisticsExtent, Store};

/// Pixels are divided anew if that is expected to save more than this fraction of the next batch's time …
const LEAST_GAIN: f64 = 0.03;
/// … and more than this many times the time of moving statistics.
const GAIN_PER_MOVE: f64 = 2.0;
/// Assumed bytes per second until some are measured.
const ASSUMED_RATE: f64 = 1e9;

/// The first process of a group.
pub struct Coordinator<'s> {
    link: &'s Link,
    part: OwnPart<'s>,
    /// Seconds per sample.
    costs: TileCosts,
    /// Seconds that each process needed for the batch, and the costs that were expected of its samples.
    seconds: Vec<f64>,
    expected: Vec<f64>,
    /// Bytes per second of the latest move of statistics.
    rate: f64,
    /// Set by a signal to any process.
    interrupt: &'s AtomicBool,
}

impl<'s> Coordinator<'s> {
    /// Divides an image. `renderer` renders all of it, into stores with reservoirs of `capacity` sample vectors and this seed.
    pub(super) fn new(
        link: &'s Link,
        renderer: &Renderer<'s>,
        (capacity, seed): (usize, u64),
        interrupt: &'s AtomicBool,
    ) -> Self {
        let (width, height) = renderer.resolution();
        let costs = TileCosts::uniform(width, height, 1.0);
        let parts = costs.partition(link.size());
        let whole = renderer.recording(renderer.layout().blocks());
        let part = OwnPart::new(whole, (capacity, seed), parts, 0);
        let none = vec![0.0; link.size()];
        Self { link, part, costs, seconds: none.clone(), expected: none, rate: ASSUMED_RATE, interrupt }
    }

    fn command(&self, command: &Command) {
        (1..self.link.size()).for_each(|rank| self.link.tell(rank, command));
    }

    /// Learns from the times of the latest batch what samples cost.
    fn learn(&mut self) {
        for (rank, rectangle) in self.part.parts.iter().enumerate() {
            if self.expected[rank] > 0.0 && self.seconds[rank] > 0.0 {
                self.costs.scale(rectangle, self.seconds[rank] / self.expected[rank]);
            }
        }
        self.seconds.fill(0.0);
        self.expected.fill(0.0);
    }

    /// Returns the owners of a batch of these expected seconds, if other ones than now pay.
    fn better_parts(&self, costs: &TileCosts) -> Option<Vec<Rectangle>> {
        let parts = costs.partition(self.link.size());
        let slowest = |parts: &[Rectangle]| parts.iter().map(|part| costs.cost_in(part)).fold(0.0, f64::max);
        let (now, then) = (slowest(&self.part.parts), slowest(&parts));
        let stays = |(a, b): (&Rectangle, &Rectangle)| a.intersection(b).map_or(0, |both| both.pixels());
        let moved = |rank: usize| parts[rank].pixels() - stays((&parts[rank], &self.part.parts[rank]));
        let pixels = (0..parts.len()).map(moved).max().unwrap_or(0);
        let kind = &self.part.kind;
        let seconds = (pixels * Store::bytes_per_pixel(&kind.layout, kind.capacity)) as f64 / self.rate;
        (now - then > (LEAST_GAIN * now).max(GAIN_PER_MOVE * seconds)).then_some(parts)
    }
}

impl ProcessGroup for Coordinator<'_> {
    fn begin(&mut self, store: &Store) {
        let StoreKind { capacity, seed, ref layout } = self.part.kind;
        let blocks = layout.blocks();
        let (parts, is_empty) = (self.part.parts.clone(), store.samples_taken() == 0);
        self.command(&Command::Begin { blocks, capacity, seed, parts, is_empty });
        if !is_empty {
            self.part.scatter(self.link, Some(store));
        }
    }

    fn begin_batch(&mut self, counts: &[u32]) {
        let is_measured = self.seconds.iter().any(|&seconds| seconds > 0.0);
        self.learn();
        let costs = self.costs.times_counts(counts);
        if let Some(parts) = self.better_parts(&costs).filter(|_| is_measured) {
            self.command(&Command::Divide { parts: parts.clone() });
            self.part.divide(self.link, parts);
        }
    }

    fn render(&mut self, counts: &[u32]) -> Rendered {
        // Send the counts of each process
        let width = self.part.image().width();
        let of =
            |rectangle: &Rectangle| rectangle.select(counts, width).flatten().copied().collect::<Vec<u32>>();
        let message = |rank: usize| {
            let bytes = encode_counts(&of(&self.part.parts[rank]));
            self.link.tell(rank, &Command::Render { bytes: bytes.len() });
            (rank, bytes)
        };
        let messages: Vec<_> = (1..self.link.size()).map(message).collect();
        let own_counts = of(&self.part.place());
        let expected = self.costs.times_counts(counts);
        // MPI may move a large message only while this process calls it, which it does not while it renders.
        self.link.send_all(&messages, || ());

        // Take the samples of this one, and wait for the others
        let own = self.part.render(&own_counts, self.interrupt);
        let others = (1..self.link.size()).map(|rank| self.link.hear::<Answer>(rank));
        let answers: Vec<Answer> = std::iter::once(own).chain(others).collect();

        // Add up
        let mut samples = SampleTotals::default();
        let mut first_rejected = None;
        for (rank, answer) in answers.iter().enumerate() {
            let place = self.part.parts[rank];
            samples += answer.samples;
            self.seconds[rank] += answer.seconds;
            self.expected[rank] += expected.cost_in(&place);
            let rejected = answer.first_rejected.map(|(y, x, index)| RejectedSample {
                y: y + place.y[0],
                x: x + place.x[0],
                index,
            });
            first_rejected = [first_rejected, rejected].into_iter().flatten().min();
            if answer.is_interrupted {
                self.interrupt.store(true, Ordering::Relaxed);
            }
        }
        Rendered { samples, first_rejected }
    }

    fn gather(&mut self, store: &mut Store, extent: StatisticsExtent) {
        self.command(&Command::Gather { extent });
        let started = Instant::now();
        self.part.gather(self.link, extent, Some(store));
        let bytes = self.part.kind.bytes(&self.part.image(), extent);
        self.rate = bytes as f64 / started.elapsed().as_secs_f64().max(1e-6);
    }

    fn can_share(&self, denoiser: &dyn Denoiser, store: &Store) -> bool {
        // What few samples say depends on pixels that may be far away.
        let is_sampled = || store.counts(Part::Whole).iter().all(|&n| n >= 2);
        let tiles = TileCosts::uniform(store.width(), store.height(), 1.0).len();
        denoiser.parts().is_some() && tiles >= self.link.size() && is_sampled()
    }

    fn filter(&mut self, denoiser: &'static dyn Denoiser) -> FilterResult {
        self.command(&Command::Filter { denoiser: denoiser.name() });
        let result = denoiser.parts().and_then(|parts| self.part.filter(self.link, parts));
        result.expect("a denoiser of parts, whose results the first process gets")
    }

    fn filter_store(&mut self, denoiser: &'static dyn Denoiser, store: &Store) -> FilterResult {
        let (width, height, capacity) = (store.width(), store.height(), store.capacity());
        self.command(&Command::FilterStore { denoiser: denoiser.name(), width, height, capacity });
        let kind = (width, height, capacity);
        let filter = |parts| self.part.filter_store(self.link, parts, kind, Some(store));
        denoiser.parts().and_then(filter).expect("a denoiser of parts, whose results the first process gets")
    }

    fn count(&self) -> usize {
        self.link.size()
    }

    fn prepare_memory(&mut self, bytes_per_pixel: usize) {
        let bytes = bytes_per_pixel * self.part.image().pixels() / self.link.size();
        self.command(&Command::PrepareMemory { bytes });
        memory::prepare(bytes);
    }

    fn records(&mut self) -> Vec<ProcessRecord> {
        self.command(&Command::Record);
        let own = self.part.record(self.link);
        std::iter::once(own).chain((1..self.link.size()).map(|rank| self.link.hear(rank))).collect()
    }
}
