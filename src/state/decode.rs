//! Decodes a render state from bytes (see [`mod@super::format`]) and checks that its parts fit together.
//!
//! No sequence of bytes makes it panic or reserve more memory than the file's length calls for.

use std::sync::Arc;

use rayon::prelude::*;

use super::array_bytes::ArrayReader;
use super::error::StateErrorKind;
use super::format::{ArraySizes, CHECKSUM, MAGIC, PREAMBLE, VERSION};
use super::header::{EstimateHeader, Header, RerunHeader, UnderWayHeader};
use super::render_state::RenderState;
use crate::adaptive::Allocation;
use crate::progressive::{ErrorEstimate, Memory, Rerun, Snapshot, UnderWay};
use crate::stats::{Layout, Part, Row, RowError, Store};

/// Decodes a state.
///
/// # Errors
/// Bytes that are no state, a state of another version, or a damaged one.
pub fn decode(file: &[u8]) -> Result<RenderState, StateErrorKind> {
    let content = verify(file)?;

    // From here on errors mean that the file was written wrongly, not damaged
    let wrong = |what: &str| StateErrorKind::Header(what.to_owned());
    let rest = &content[PREAMBLE..];
    let text = usize::try_from(number(file, 20)).ok().and_then(|length| rest.split_at_checked(length));
    let (text, arrays) = text.ok_or_else(|| wrong("its length is beyond the file's end"))?;
    let header: Header =
        serde_json::from_slice(text).map_err(|error| StateErrorKind::Header(error.to_string()))?;

    // Compare the sizes with the bytes that are there
    let layout = Layout::of_names(&header.dimensions).ok_or_else(|| wrong("unknown dimensions"))?;
    let sizes = ArraySizes::new(&header, &layout).ok_or_else(|| wrong("a size beyond all memory"))?;
    // An image without columns takes no bytes, however many rows it has.
    if sizes.width == 0 || sizes.height == 0 {
        return Err(wrong("an image without pixels"));
    }
    if sizes.bytes() != Some(arrays.len()) {
        return Err(wrong("its sizes are not those of the arrays"));
    }

    let memory = decode_memory(&header, layout, &sizes, ArrayReader(arrays))?;
    check(&memory)?;
    Ok(RenderState { metadata: header.metadata, settings: header.settings, streams: header.streams, memory })
}

/// Checks signature, version, length and checksum; returns the bytes before the checksum.
fn verify(file: &[u8]) -> Result<&[u8], StateErrorKind> {
    if !file.starts_with(MAGIC) {
        return Err(StateErrorKind::Foreign);
    }
    if file.len() < PREAMBLE + CHECKSUM {
        return Err(StateErrorKind::Length { found: file.len(), expected: (PREAMBLE + CHECKSUM) as u64 });
    }
    let version = number(file, 8) as u32;
    if version != VERSION {
        return Err(StateErrorKind::Version(version));
    }
    let expected = number(file, 12);
    if expected != file.len() as u64 {
        return Err(StateErrorKind::Length { found: file.len(), expected });
    }
    let (content, checksum) = file.split_at(file.len() - CHECKSUM);
    if crc32fast::hash(content).to_le_bytes() != checksum {
        return Err(StateErrorKind::Checksum);
    }
    Ok(content)
}

/// Reads the little-endian u64 at a byte of the preamble.
fn number(file: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|i| file[at + i]))
}

/// Decodes the arrays, in the order in which [`super::encode()`] writes them.
fn decode_memory(
    header: &Header,
    layout: Layout,
    sizes: &ArraySizes,
    mut arrays: ArrayReader,
) -> Result<Memory, StateErrorKind> {
    let store = decode_store(header, layout, sizes, &mut arrays)?;
    let estimate = header.estimate.as_ref().zip(sizes.tiles);
    let estimate = estimate.map(|(header, tiles)| decode_estimate(header, tiles, &mut arrays));
    let rerun = header.rerun.as_ref().map(|header| decode_rerun(header, sizes, &mut arrays));
    let under_way = header.under_way.as_ref().map(|header| decode_batch(header, sizes, &mut arrays));
    Ok(Memory {
        store: Arc::new(store),
        batches: header.batches.clone(),
        estimate,
        rerun,
        under_way,
        recent: header.recent,
    })
}

fn decode_store(
    header: &Header,
    layout: Layout,
    &ArraySizes { width, height, row, .. }: &ArraySizes,
    arrays: &mut ArrayReader,
) -> Result<Store, RowError> {
    let mut store = Store::new(width, height, layout, header.capacity, header.settings.seed);
    let rows = arrays.bytes(row * height).par_chunks(row.max(1));
    store.rows_mut().par_iter_mut().zip(rows).try_for_each(|(row, bytes)| row.read_bytes(bytes))?;
    Ok(store)
}

fn decode_estimate(header: &EstimateHeader, tiles: [usize; 2], arrays: &mut ArrayReader) -> ErrorEstimate {
    ErrorEstimate {
        image: header.image,
        standard_error: header.standard_error,
        samples: header.samples,
        tiles: arrays.planes(tiles[0], tiles[1], 1),
    }
}

fn decode_rerun(
    header: &RerunHeader,
    &ArraySizes { width, height, .. }: &ArraySizes,
    arrays: &mut ArrayReader,
) -> Rerun {
    let pixels = width * height;
    Rerun {
        image: arrays.planes(width, height, 3),
        variance: arrays.planes(width, height, 3),
        residual: arrays.planes(width, height, 1),
        failure: header.failure.then(|| arrays.planes(width, height, 1)),
        success: header.success,
        made_of: Snapshot {
            mean: std::array::from_fn(|_| arrays.planes(width, height, 3)),
            count: std::array::from_fn(|_| arrays.counts(pixels)),
        },
        probes: arrays.flags(pixels),
    }
}

fn decode_batch(header: &UnderWayHeader, sizes: &ArraySizes, arrays: &mut ArrayReader) -> UnderWay {
    let pixels = sizes.width * sizes.height;
    UnderWay {
        allocation: Allocation { counts: arrays.counts(pixels), probes: arrays.flags(pixels) },
        done: header.done,
        grain: header.grain,
    }
}

/// Checks that the parts fit together, as the render loop assumes.
fn check(memory: &Memory) -> Result<(), StateErrorKind> {
    let wrong = |what: &str| Err(StateErrorKind::Header(what.to_owned()));
    if let Some(rerun) = &memory.rerun {
        for (h, before) in rerun.made_of.count.iter().enumerate() {
            if before.iter().zip(memory.store.counts(Part::Half(h))).any(|(&before, now)| before > now) {
                return wrong("an image of more samples than the store has");
            }
        }
    }
    if let Some(batch) = &memory.under_way {
        let fits = |(x, row): (usize, &Row), n: u32| row.next_index(x).checked_add(n).is_some();
        let width = memory.store.width().max(1);
        let mut rows = memory.store.rows().iter().zip(batch.allocation.counts.chunks(width));
        let all_fit = rows.all(|(row, counts)| counts.iter().enumerate().all(|(x, &n)| fits((x, row), n)));
        if !(0.0..=1.0).contains(&batch.done) || !all_fit {
            return wrong("an unfinished batch with a progress outside [0, 1] or too many samples");
        }
    }
    let (samples, seconds) = memory.recent;
    if !(samples >= 0.0 && seconds >= 0.0) {
        return wrong("a negative sampling rate");
    }
    Ok(())
}
