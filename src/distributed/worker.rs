//! A process that serves the first one: takes the samples of its pixels and keeps their statistics.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::command::{Answer, Command, decode_counts};
use super::exchange::{StoreKind, exchange};
use super::link::Link;
use super::partition::TileCosts;
use super::processes::host;
use super::shared_image::{SharedImage, gather_results};
use crate::filter::{Denoiser, DenoiserName, FilterResult, PartFilter, WholeImage, find};
use crate::memory::{self, peak_bytes};
use crate::progressive::{ProcessRecord, SampleTotals};
use crate::render::{RejectedSample, Renderer};
use crate::stats::{Rectangle, StatisticsExtent, Store};

/// The pixels of a process.
pub struct OwnPart<'s> {
    /// Of the whole image, and of this process's pixels.
    whole: Renderer<'s>,
    renderer: Renderer<'s>,
    pub kind: StoreKind,
    /// The pixels of each process.
    pub parts: Vec<Rectangle>,
    rank: usize,
    store: Store,
    /// Seconds in which samples were taken.
    render_seconds: f64,
    filter_seconds: f64,
}

impl<'s> OwnPart<'s> {
    /// Begins without samples. `whole` renders the whole image, with the dimensions of which statistics are kept.
    pub fn new(
        whole: Renderer<'s>,
        (capacity, seed): (usize, u64),
        parts: Vec<Rectangle>,
        rank: usize,
    ) -> Self {
        let kind = StoreKind { layout: whole.layout().clone(), capacity, seed };
        let store = kind.empty(&parts[rank]);
        let renderer = part_of(&whole, &parts[rank]);
        Self { whole, renderer, kind, parts, rank, store, render_seconds: 0.0, filter_seconds: 0.0 }
    }

    /// Returns the rectangle of this process.
    pub fn place(&self) -> Rectangle {
        self.parts[self.rank]
    }

    /// Takes samples: `counts` are those of this process's pixels.
    pub fn render(&mut self, counts: &[u32], interrupt: &AtomicBool) -> Answer {
        let started = Instant::now();
        let rejected = self.renderer.render_batch(counts, &mut self.store);
        let seconds = started.elapsed().as_secs_f64();
        self.render_seconds += seconds;
        Answer {
            samples: SampleTotals::new(&self.store),
            first_rejected: rejected.map(|RejectedSample { y, x, index }| (y, x, index)),
            seconds,
            is_interrupted: interrupt.load(Ordering::Relaxed),
        }
    }

    /// Gives the pixels other owners, with their statistics.
    pub fn divide(&mut self, link: &Link, parts: Vec<Rectangle>) {
        let mut store = self.kind.empty(&parts[self.rank]);
        let (have, want) = (all(&self.parts), all(&parts));
        let kind = (&self.kind, StatisticsExtent::All);
        exchange(link, kind, (&have, Some(&self.store)), (&want, Some(&mut store)));
        (self.parts, self.store) = (parts, store);
        self.renderer = part_of(&self.whole, &self.place());
    }

    /// Gathers statistics of all processes in the first one, which passes a store of the whole image.
    pub fn gather(&self, link: &Link, extent: StatisticsExtent, whole: Option<&mut Store>) {
        let want = only_first(self.image(), self.parts.len());
        exchange(link, (&self.kind, extent), (&all(&self.parts), Some(&self.store)), (&want, whole));
    }

    /// Takes the statistics of its pixels from the first process, which passes a store of the whole image.
    pub fn scatter(&mut self, link: &Link, whole: Option<&Store>) {
        let have = only_first(self.image(), self.parts.len());
        let kind = (&self.kind, StatisticsExtent::All);
        exchange(link, kind, (&have, whole), (&all(&self.parts), Some(&mut self.store)));
    }

    /// Filters the pixels of this process, with a margin that it takes from others, and gathers the results in the first
    /// process, which gets that of the whole image.
    pub fn filter(&mut self, link: &Link, denoiser: &dyn PartFilter) -> Option<FilterResult> {
        let have = all(&self.parts);
        let (result, seconds) =
            filter_parts(link, denoiser, (self.image(), &self.parts), &self.kind, (&have, Some(&self.store)));
        self.filter_seconds += seconds;
        result
    }

    /// Filters an image whose statistics the first process passes, with reservoirs of `capacity` sample vectors: each process a
    /// part of it. The first one gets the result.
    pub fn filter_store(
        &mut self,
        link: &Link,
        denoiser: &dyn PartFilter,
        (width, height, capacity): (usize, usize, usize),
        store: Option<&Store>,
    ) -> Option<FilterResult> {
        let image = Rectangle::whole(width, height);
        let parts = TileCosts::uniform(width, height, 1.0).partition(link.size());
        let kind = StoreKind { capacity, ..self.kind.clone() };
        let have = only_first(image, parts.len());
        let (result, seconds) = filter_parts(link, denoiser, (image, &parts), &kind, (&have, store));
        self.filter_seconds += seconds;
        result
    }

    /// Returns what this process has done.
    pub fn record(&self, link: &Link) -> ProcessRecord {
        ProcessRecord {
            host: host(),
            threads: rayon::current_num_threads(),
            pixels: self.store.pixels(),
            render: self.render_seconds,
            filter: self.filter_seconds,
            transfer: link.transfer_seconds(),
            bytes_sent: link.bytes_sent(),
            peak_memory_bytes: peak_bytes(),
        }
    }

    /// Returns the rectangle of all pixels.
    pub fn image(&self) -> Rectangle {
        let (width, height) = self.whole.resolution();
        Rectangle::whole(width, height)
    }
}

fn part_of<'s>(whole: &Renderer<'s>, part: &Rectangle) -> Renderer<'s> {
    whole.recording(whole.layout().blocks()).with_part(part)
}

/// Filters an image, each process its part, with a margin. `have` and `own`: the rectangles of which processes have the statistics,
/// and those of this process. Returns the result in the first process, and the seconds of this one's part.
fn filter_parts(
    link: &Link,
    denoiser: &dyn PartFilter,
    (image, parts): (Rectangle, &[Rectangle]),
    kind: &StoreKind,
    (have, own): (&[Option<Rectangle>], Option<&Store>),
) -> (Option<FilterResult>, f64) {
    // Take the margin
    let grown: Vec<Rectangle> = parts.iter().map(|part| part.grown(denoiser.margin(), &image)).collect();
    let mut store = kind.empty(&grown[link.rank()]);
    exchange(link, (kind, StatisticsExtent::All), (have, own), (&all(&grown), Some(&mut store)));

    // Filter, and send the result without the margin
    let started = Instant::now();
    let whole = SharedImage { link, parts, grown: &grown };
    let result = denoiser.filter_part(&store, &whole);
    let seconds = started.elapsed().as_secs_f64();
    (gather_results(link, parts, &image, (result, whole.part())), seconds)
}

fn all(parts: &[Rectangle]) -> Vec<Option<Rectangle>> {
    parts.iter().copied().map(Some).collect()
}

fn only_first(rectangle: Rectangle, processes: usize) -> Vec<Option<Rectangle>> {
    (0..processes).map(|rank| (rank == 0).then_some(rectangle)).collect()
}

/// Serves the first process until it ends. `renderer` renders the whole image.
pub fn serve(link: &Link, renderer: &Renderer, interrupt: &AtomicBool) {
    let mut part: Option<OwnPart> = None;
    loop {
        let command: Command = link.next(0);
        match (command, &mut part) {
            (Command::End, _) => return,
            (Command::Begin { blocks, capacity, seed, parts, is_empty }, _) => {
                let whole = renderer.recording(blocks);
                let part = part.insert(OwnPart::new(whole, (capacity, seed), parts, link.rank()));
                if !is_empty {
                    part.scatter(link, None);
                }
            }
            (Command::Divide { parts }, Some(part)) => part.divide(link, parts),
            (Command::Render { bytes }, Some(part)) => {
                let counts = decode_counts(&link.receive(0, bytes));
                link.tell(0, &part.render(&counts, interrupt));
            }
            (Command::Gather { extent }, Some(part)) => part.gather(link, extent, None),
            (Command::Filter { denoiser }, Some(part)) => {
                part.filter(link, parts_of(&denoiser));
            }
            (Command::FilterStore { denoiser, width, height, capacity }, Some(part)) => {
                part.filter_store(link, parts_of(&denoiser), (width, height, capacity), None);
            }
            (Command::PrepareMemory { bytes }, Some(_)) => {
                memory::prepare(bytes);
            }
            (Command::Record, Some(part)) => link.tell(0, &part.record(link)),
            (_, None) => unreachable!("a render begins first"),
        }
    }
}

/// Returns the denoiser of this name, which the first process knows to be one of parts.
fn parts_of(name: &DenoiserName) -> &'static dyn PartFilter {
    find(name.method, name.preset)
        .and_then(Denoiser::parts)
        .expect("the first process knows what can be shared")
}
