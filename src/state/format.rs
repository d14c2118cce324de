//! The bytes of a state.
//!
//! | bytes | what |
//! | --- | --- |
//! | 8 | `prpfstat` |
//! | 4 | version of the format |
//! | 8 | length of the file |
//! | 8 | length of the header |
//! | … | the header: JSON in UTF-8 |
//! | … | the arrays that the header calls for |
//! | 4 | CRC-32 (IEEE) of all before |
//!
//! Numbers are little endian. The arrays, in this order: the store, row by row, each as
//! [`crate::stats::Row::to_bytes`] has it; with an estimate its tiles (f32); with a rerun its image,
//! variance, residual and, if it has them, failures (f32), the means of both halves (f32) and their
//! counts (u32) that the image was made of, and the probes (u8); with a batch under way its counts
//! (u32) and probes (u8).

use std::io;
use std::sync::Arc;

use rayon::prelude::*;

use super::State;
use super::arrays::{Reader, Writer};
use super::header::{EstimateHeader, Header, RerunHeader, UnderWayHeader};
use crate::adaptive::Allocation;
use crate::progressive::{ErrorEstimate, Memory, Rerun, Snapshot, TILE, UnderWay};
use crate::stats::{Layout, Part, Row, RowError, Store};

/// Of the format; a state of another one is not read.
pub const VERSION: u32 = 1;

pub(super) const MAGIC: &[u8; 8] = b"prpfstat";
/// Magic, version and the two lengths.
const PREAMBLE: usize = 8 + 4 + 8 + 8;
/// Bytes by which the headers of later states of a render may be longer than that of the first.
const ROOM_FOR_HEADERS: usize = 1 << 16;
/// Length of the checksum.
const CHECKSUM: usize = 4;

/// Why something is no state.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    #[error("{}", said(.0))]
    File(#[from] io::Error),
    #[error("found no render state; accepted is what `prpf render --state` writes")]
    Foreign,
    #[error("found a render state of version {0}; accepted is version {VERSION}")]
    Version(u32),
    #[error("found {found} bytes of a render state of {expected}; it was cut off or added to")]
    Length { found: usize, expected: u64 },
    #[error("the render state is damaged: its checksum is not that of its content")]
    Checksum,
    #[error("the render state's header is wrong: {0}")]
    Header(String),
    #[error("the render state's store is wrong: {0}")]
    Row(#[from] RowError),
}

/// An error of the system without its number.
fn said(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file or folder".to_owned(),
        _ => error.to_string(),
    }
}

/// Lengths of the arrays, from what the header says.
struct Shape {
    width: usize,
    height: usize,
    row: usize,
    /// Bytes per pixel beside the store.
    beside: usize,
    tiles: Option<[usize; 2]>,
}

impl Shape {
    /// `None` if that is no shape, or none of this world.
    fn of(header: &Header, layout: &Layout) -> Option<Self> {
        let [width, height] = header.frame.resolution()?;
        let rerun = header.rerun.as_ref();
        // Image, variance, residual, failures; means and counts of halves; probes.
        let of_rerun = |rerun: &RerunHeader| 4 * (3 + 3 + 1 + usize::from(rerun.failure)) + 4 * (6 + 2) + 1;
        let under_way = header.under_way.as_ref().map_or(0, |_| 4 + 1);
        Some(Self {
            width,
            height,
            row: Row::byte_len(width, layout.len(), header.capacity)?,
            beside: rerun.map_or(0, of_rerun) + under_way,
            tiles: header.estimate.as_ref().map(|_| [width.div_ceil(TILE), height.div_ceil(TILE)]),
        })
    }

    fn bytes(&self) -> Option<usize> {
        let pixels = self.width.checked_mul(self.height)?;
        let tiles = self.tiles.map_or(Some(0), |[x, y]| x.checked_mul(y)?.checked_mul(4))?;
        self.row.checked_mul(self.height)?.checked_add(pixels.checked_mul(self.beside)?)?.checked_add(tiles)
    }
}

pub(super) fn header(state: &State) -> Header {
    let Memory { store, batches, estimate, rerun, under_way, recent } = &state.memory;
    Header {
        program: env!("CARGO_PKG_VERSION").to_owned(),
        frame: state.frame.clone(),
        settings: state.settings.clone(),
        streams: state.streams.clone(),
        dimensions: store.layout().dimensions().iter().map(|d| d.name.to_owned()).collect(),
        capacity: store.capacity(),
        batches: batches.clone(),
        recent: *recent,
        estimate: estimate.as_ref().map(|e| EstimateHeader {
            image: e.image,
            standard_error: e.standard_error,
            samples: e.samples,
        }),
        rerun: rerun.as_ref().map(|r| RerunHeader { failure: r.failure.is_some(), success: r.success }),
        under_way: under_way.as_ref().map(|u| UnderWayHeader { done: u.done, grain: u.grain }),
    }
}

/// The bytes of a state, in place of what `file` held. In parallel on rayon's current pool.
pub fn bytes(state: &State, file: &mut Vec<u8>) {
    let Memory { store, estimate, rerun, under_way, .. } = &state.memory;
    let header = header(state);
    let text = serde_json::to_vec(&header).expect("a header has no keys other than text");
    let shape = Shape::of(&header, store.layout()).and_then(|shape| Some((shape.bytes()?, shape)));
    let (arrays, shape) = shape.expect("what is in memory has a size");
    let length = PREAMBLE + text.len() + arrays + CHECKSUM;
    if file.capacity() < length {
        // Headers grow by little; beyond its capacity a vector would grow to twice its size.
        *file = Vec::with_capacity(length + ROOM_FOR_HEADERS);
    }
    file.resize(length, 0);

    let (content, checksum) = file.split_at_mut(length - CHECKSUM);
    content[..8].copy_from_slice(MAGIC);
    content[8..12].copy_from_slice(&VERSION.to_le_bytes());
    content[12..20].copy_from_slice(&(length as u64).to_le_bytes());
    content[20..28].copy_from_slice(&(text.len() as u64).to_le_bytes());
    content[PREAMBLE..][..text.len()].copy_from_slice(&text);
    let (rows, rest) = content[PREAMBLE + text.len()..].split_at_mut(shape.row * shape.height);
    rows.par_chunks_mut(shape.row.max(1)).zip(store.rows()).for_each(|(out, row)| row.to_bytes(out));
    let mut out = Writer(rest);
    if let Some(estimate) = estimate {
        out.planes(&estimate.tiles);
    }
    if let Some(rerun) = rerun {
        let Rerun { image, variance, residual, failure, made_of, probes, .. } = rerun;
        [image, variance, residual].into_iter().chain(failure).for_each(|planes| out.planes(planes));
        made_of.mean.iter().for_each(|mean| out.planes(mean));
        made_of.count.iter().for_each(|count| out.counts(count));
        out.flags(probes);
    }
    if let Some(batch) = under_way {
        out.counts(&batch.allocation.counts);
        out.flags(&batch.allocation.probes);
    }
    checksum.copy_from_slice(&crc32fast::hash(content).to_le_bytes());
}

/// Bytes that a state of a render takes, about, without its header.
pub fn size(layout: &Layout, capacity: usize, pixels: usize) -> Option<usize> {
    /// Of the latest rerun and the batch under way, per pixel.
    const BESIDE_STORE: usize = 4 * (8 + 6 + 2 + 1) + 2;
    Row::byte_len(1, layout.len(), capacity)?.checked_add(BESIDE_STORE)?.checked_mul(pixels)
}

/// The state that bytes are.
///
/// # Errors
/// Bytes that are no state, one of another version, or a damaged one.
pub fn read_bytes(file: &[u8]) -> Result<State, Problem> {
    let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| file[at + i]));
    if !file.starts_with(MAGIC) {
        return Err(Problem::Foreign);
    }
    if file.len() < PREAMBLE + CHECKSUM {
        return Err(Problem::Length { found: file.len(), expected: (PREAMBLE + CHECKSUM) as u64 });
    }
    let version = number(8) as u32;
    if version != VERSION {
        return Err(Problem::Version(version));
    }
    if number(12) != file.len() as u64 {
        return Err(Problem::Length { found: file.len(), expected: number(12) });
    }
    let (content, checksum) = file.split_at(file.len() - CHECKSUM);
    if crc32fast::hash(content).to_le_bytes() != checksum {
        return Err(Problem::Checksum);
    }

    // What follows can only be wrong if it was written so.
    let wrong = |what: &str| Problem::Header(what.to_owned());
    let rest = &content[PREAMBLE..];
    let text = usize::try_from(number(20)).ok().and_then(|length| rest.split_at_checked(length));
    let (text, arrays) = text.ok_or_else(|| wrong("its length is beyond the file's end"))?;
    let header: Header = serde_json::from_slice(text).map_err(|error| Problem::Header(error.to_string()))?;
    let layout = Layout::of_names(&header.dimensions).ok_or_else(|| wrong("unknown dimensions"))?;
    let shape = Shape::of(&header, &layout).ok_or_else(|| wrong("a size beyond all memory"))?;
    // Such an image takes no bytes, however many rows it has.
    if shape.width == 0 || shape.height == 0 {
        return Err(wrong("an image without pixels"));
    }
    if shape.bytes() != Some(arrays.len()) {
        return Err(wrong("its sizes are not those of the arrays"));
    }
    let memory = memory(&header, layout, &shape, Reader(arrays))?;
    Ok(State { frame: header.frame, settings: header.settings, streams: header.streams, memory })
}

fn memory(header: &Header, layout: Layout, shape: &Shape, mut arrays: Reader) -> Result<Memory, Problem> {
    let &Shape { width, height, row, .. } = shape;
    let pixels = width * height;
    let mut store = Store::new(width, height, layout, header.capacity, header.settings.seed);
    let rows = arrays.bytes(row * height).par_chunks(row.max(1));
    store.rows_mut().par_iter_mut().zip(rows).try_for_each(|(row, bytes)| row.read_bytes(bytes))?;

    let estimate = header.estimate.as_ref().zip(shape.tiles).map(|(e, [x, y])| ErrorEstimate {
        image: e.image,
        standard_error: e.standard_error,
        samples: e.samples,
        tiles: arrays.planes(x, y, 1),
    });
    let rerun = header.rerun.as_ref().map(|r| Rerun {
        image: arrays.planes(width, height, 3),
        variance: arrays.planes(width, height, 3),
        residual: arrays.planes(width, height, 1),
        failure: r.failure.then(|| arrays.planes(width, height, 1)),
        success: r.success,
        made_of: Snapshot {
            mean: std::array::from_fn(|_| arrays.planes(width, height, 3)),
            count: std::array::from_fn(|_| arrays.counts(pixels)),
        },
        probes: arrays.flags(pixels),
    });
    let under_way = header.under_way.as_ref().map(|u| UnderWay {
        allocation: Allocation { counts: arrays.counts(pixels), probes: arrays.flags(pixels) },
        done: u.done,
        grain: u.grain,
    });
    let memory = Memory {
        store: Arc::new(store),
        batches: header.batches.clone(),
        estimate,
        rerun,
        under_way,
        recent: header.recent,
    };
    check(&memory)?;
    Ok(memory)
}

/// Whether the parts fit together: what the loop takes for granted.
fn check(memory: &Memory) -> Result<(), Problem> {
    let wrong = |what: &str| Err(Problem::Header(what.to_owned()));
    if let Some(rerun) = &memory.rerun {
        for (h, before) in rerun.made_of.count.iter().enumerate() {
            if before.iter().zip(memory.store.counts(Part::Half(h))).any(|(&before, now)| before > now) {
                return wrong("an image of more samples than there are");
            }
        }
    }
    if let Some(batch) = &memory.under_way {
        let room = |(x, row): (usize, &Row), n: u32| row.next_index(x).checked_add(n).is_some();
        let width = memory.store.width().max(1);
        let rows = memory.store.rows().iter().zip(batch.allocation.counts.chunks(width));
        let fits =
            rows.flat_map(|(row, counts)| counts.iter().enumerate().map(move |(x, &n)| room((x, row), n)));
        if !(0.0..=1.0).contains(&batch.done) || !fits.into_iter().all(|fits| fits) {
            return wrong("a batch that cannot be");
        }
    }
    let (samples, seconds) = memory.recent;
    if !(samples >= 0.0 && seconds >= 0.0) {
        return wrong("a speed below zero");
    }
    Ok(())
}
