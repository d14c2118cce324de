//! Decodes a render state from bytes (see [`mod@super::format`]) and checks that its parts fit together.
//!
//! No sequence of bytes makes it panic or reserve more memory than the file's length calls for.

use std::sync::Arc;

use rayon::prelude::*;

use super::array_bytes::ArrayReader;
use super::error::StateErrorKind;
use super::format::{ArraySizes, CHECKSUM, MAGIC, PREAMBLE, VERSION};
use super::header::{EstimateHeader, Header, InterimHeader, PositionHeader};
use super::image_metadata::ImageMetadata;
use super::render_state::RenderState;
use crate::filter::Interpolation;
use crate::memory::check_available;
use crate::progressive::{Checkpoint, ErrorEstimate, Grain, InterimPass, Position, SampleBatch, Speed};
use crate::stats::{Layout, PIXEL_BLOCK, Row, Store};

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
    header.settings.validate().map_err(|error| StateErrorKind::Header(error.to_string()))?;
    let ImageMetadata { diameter, origin, .. } = &header.metadata;
    if !(*diameter > 0.0 && diameter.is_finite() && origin.iter().all(|v| v.is_finite())) {
        return Err(wrong("a scene without finite size or origin"));
    }

    // Compare the sizes with the bytes that are there
    let layout = Layout::from_names(&header.dimensions, &header.left_out)
        .ok_or_else(|| wrong("unknown dimensions"))?;
    let sizes = ArraySizes::new(&header, &layout).ok_or_else(|| wrong("a size beyond all memory"))?;
    // An image without columns takes no bytes, however many rows it has.
    if sizes.width == 0 || sizes.height == 0 {
        return Err(wrong("an image without pixels"));
    }
    if sizes.bytes() != Some(arrays.len()) {
        return Err(wrong("its sizes are not those of the arrays"));
    }

    let checkpoint = decode_checkpoint(&header, layout, &sizes, ArrayReader(arrays))?;
    check(&checkpoint)?;
    Ok(RenderState {
        metadata: header.metadata,
        settings: header.settings,
        weights: header.weights,
        streams: header.streams,
        checkpoint,
    })
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
fn decode_checkpoint(
    header: &Header,
    layout: Layout,
    sizes: &ArraySizes,
    mut arrays: ArrayReader,
) -> Result<Checkpoint, StateErrorKind> {
    let store = decode_store(header, layout, sizes, &mut arrays)?;
    let interim = header.interim.as_ref().map(|header| decode_interim(header, sizes, &mut arrays));
    let position = match header.position {
        PositionHeader::Plan => Position::Plan,
        PositionHeader::Render { done, grain } => {
            Position::Render(decode_batch(done, grain, sizes, &mut arrays))
        }
        PositionHeader::Filter => Position::Filter,
    };
    let (passes, speed) = (header.passes.clone(), header.speed);
    Ok(Checkpoint { store: Arc::new(store), position, passes, interim, speed })
}

fn decode_store(
    header: &Header,
    layout: Layout,
    &ArraySizes { width, height, row, .. }: &ArraySizes,
    arrays: &mut ArrayReader,
) -> Result<Store, StateErrorKind> {
    // Of narrow images the store is larger than the file: its rows have whole blocks of pixels
    let pixels = (width.next_multiple_of(PIXEL_BLOCK) * height) as u64;
    check_available(pixels * Store::bytes_per_pixel(&layout, header.capacity) as u64)
        .map_err(StateErrorKind::Memory)?;
    let mut store = Store::new(width, height, layout, header.capacity, header.settings.seed);
    let rows = arrays.bytes(row * height).par_chunks(row.max(1));
    store.rows_mut().par_iter_mut().zip(rows).try_for_each(|(row, bytes)| row.read_bytes(bytes))?;
    Ok(store)
}

fn decode_estimate(header: &EstimateHeader, tiles: [usize; 2], arrays: &mut ArrayReader) -> ErrorEstimate {
    ErrorEstimate {
        value: header.value,
        deviation: header.deviation,
        unfiltered: header.unfiltered,
        samples: header.samples,
        tiles: arrays.planes(tiles[0], tiles[1], 1),
    }
}

fn decode_interim(
    header: &InterimHeader,
    &ArraySizes { width, height, tiles, .. }: &ArraySizes,
    arrays: &mut ArrayReader,
) -> InterimPass {
    InterimPass {
        made_by: header.made_by,
        image: arrays.planes(width, height, 3),
        variance: arrays.planes(width, height, 3),
        residual: arrays.planes(width, height, 1),
        interpolation: header
            .interpolation_success
            .map(|success| Interpolation { failure: arrays.planes(width, height, 1), success }),
        estimate: header
            .estimate
            .as_ref()
            .zip(tiles)
            .map(|(header, tiles)| decode_estimate(header, tiles, arrays)),
    }
}

fn decode_batch(done: f64, grain: Grain, sizes: &ArraySizes, arrays: &mut ArrayReader) -> SampleBatch {
    let pixels = sizes.width * sizes.height;
    SampleBatch { counts: arrays.counts(pixels), done, grain }
}

/// Checks that the parts fit together, as the render loop assumes.
fn check(checkpoint: &Checkpoint) -> Result<(), StateErrorKind> {
    let wrong = |what: &str| Err(StateErrorKind::Header(what.to_owned()));
    let estimate = checkpoint.interim.as_ref().and_then(|interim| interim.estimate.as_ref());
    if estimate.is_some_and(|estimate| estimate.samples > checkpoint.store.samples()) {
        return wrong("an image of more samples than the store has");
    }
    if estimate.is_some_and(|estimate| !(estimate.value >= 0.0 && estimate.deviation >= 0.0)) {
        return wrong("a negative error");
    }
    if let Position::Render(batch) = &checkpoint.position {
        let fits = |(x, row): (usize, &Row), n: u32| row.next_index(x).checked_add(n).is_some();
        let width = checkpoint.store.width().max(1);
        let mut rows = checkpoint.store.rows().iter().zip(batch.counts.chunks(width));
        let all_fit = rows.all(|(row, counts)| counts.iter().enumerate().all(|(x, &n)| fits((x, row), n)));
        if !(0.0..=1.0).contains(&batch.done) || !all_fit {
            return wrong("an unfinished batch with a progress outside [0, 1] or too many samples");
        }
    }
    let Speed { samples, seconds } = checkpoint.speed;
    if !(samples >= 0.0 && seconds >= 0.0) {
        return wrong("a negative sampling rate");
    }
    Ok(())
}
