//! Encodes a render state as bytes (see [`mod@super::format`]).

use rayon::prelude::*;

use super::array_bytes::ArrayWriter;
use super::format::{ArraySizes, CHECKSUM, MAGIC, PREAMBLE, VERSION};
use super::header::Header;
use super::render_state::RenderState;
use crate::progressive::{Checkpoint, InterimPass, Position};

/// Spare capacity of the buffer, in bytes: headers grow a little from one state of a render to the next.
const HEADER_GROWTH: usize = 1 << 16;

/// Writes the bytes of a state to `file`, whose content and length they replace. Runs in parallel on rayon's current
/// thread pool.
pub fn encode(state: &RenderState, file: &mut Vec<u8>) {
    // Compute all lengths
    let Checkpoint { store, position, interim, .. } = &state.checkpoint;
    let header = Header::new(state);
    let text = serde_json::to_vec(&header).expect("a header has no keys other than text");
    let sizes = ArraySizes::new(&header, store.layout()).and_then(|sizes| Some((sizes.bytes()?, sizes)));
    let (arrays, sizes) = sizes.expect("what is in memory has a size");
    let length = PREAMBLE + text.len() + arrays + CHECKSUM;
    if file.capacity() < length {
        // Growing in place would double the capacity.
        *file = Vec::with_capacity(length + HEADER_GROWTH);
    }
    file.resize(length, 0);

    // Write preamble and header
    let (content, checksum) = file.split_at_mut(length - CHECKSUM);
    content[..8].copy_from_slice(MAGIC);
    content[8..12].copy_from_slice(&VERSION.to_le_bytes());
    content[12..20].copy_from_slice(&(length as u64).to_le_bytes());
    content[20..28].copy_from_slice(&(text.len() as u64).to_le_bytes());
    content[PREAMBLE..][..text.len()].copy_from_slice(&text);

    // Write the arrays
    let (rows, rest) = content[PREAMBLE + text.len()..].split_at_mut(sizes.row * sizes.height);
    rows.par_chunks_mut(sizes.row.max(1)).zip(store.rows()).for_each(|(out, row)| row.to_bytes(out));
    let mut out = ArrayWriter(rest);
    if let Some(interim) = interim {
        let InterimPass { image, variance, residual, interpolation, estimate, .. } = interim;
        let failure = interpolation.as_ref().map(|found| &found.failure);
        let tiles = estimate.as_ref().map(|estimate| &estimate.tiles);
        let maps = [image, variance, residual].into_iter().chain(failure).chain(tiles);
        maps.for_each(|planes| out.planes(planes));
    }
    if let Position::Render(batch) = position {
        out.counts(&batch.counts);
    }

    checksum.copy_from_slice(&crc32fast::hash(content).to_le_bytes());
}
