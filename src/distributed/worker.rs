//! A process that serves the first one: takes the samples of its pixels and keeps their statistics.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::command::{Answer, Command, decode_counts};
use super::exchange::{StoreKind, exchange};
use super::link::Link;
use super::processes::host;
use super::shared_image::{SharedImage, gather_results};
use crate::filter::{Denoiser, FilterResult, PartFilter, WholeImage, find};
use crate::memory::peak_bytes;
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
        // Take the margin
        let image = self.image();
        let grown: Vec<Rectangle> =
            self.parts.iter().map(|part| part.grown(denoiser.margin(), &image)).collect();
        let place = grown[self.rank];
        let mut store = self.kind.empty(&place);
        let own = (&all(&self.parts)[..], Some(&self.store));
        exchange(link, (&self.kind, StatisticsExtent::All), own, (&all(&grown), Some(&mut store)));

        // Filter, and send the result without the margin
        let started = Instant::now();
        let whole = SharedImage { link, parts: &self.parts, grown: &grown };
        let result = denoiser.filter_part(&store, &whole);
        self.filter_seconds += started.elapsed().as_secs_f64();
        gather_results(link, &self.parts, &image, (result, whole.part()))
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
        Rectangle::of_image(width, height)
    }
}

fn part_of<'s>(whole: &Renderer<'s>, part: &Rectangle) -> Renderer<'s> {
    whole.recording(whole.layout().blocks()).with_part(part)
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
                let denoiser = find(denoiser.method, denoiser.preset).and_then(Denoiser::parts);
                part.filter(link, denoiser.expect("the first process knows what can be shared"));
            }
            (Command::Record, Some(part)) => link.tell(0, &part.record(link)),
            (_, None) => unreachable!("a render begins first"),
        }
    }
}
