//! The layout of a state file: signature, lengths and sizes of arrays.
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | `prpfstat` |
//! | 4 | [`VERSION`] of the format |
//! | 8 | length of the file |
//! | 8 | length of the header |
//! | … | the header: JSON in UTF-8 |
//! | … | the arrays that the header calls for |
//! | 4 | CRC-32 (IEEE) of all before |
//!
//! Numbers are little endian. The arrays follow in this order: the store, row by row, each as
//! [`crate::stats::Row::to_bytes`] writes it; with an interim pass its image, variance, residual and, if there are any,
//! failure map and tiles of the estimated error (f32); with an unfinished batch its counts (u32).

use super::header::{Header, InterimHeader, PositionHeader};
use crate::progressive::TILE;
use crate::stats::{Layout, Row};

/// Version of the format; states of other versions are refused.
pub const VERSION: u32 = 6;

/// The first bytes of every state file.
pub(super) const MAGIC: &[u8; 8] = b"prpfstat";
/// Length of magic, version and the two lengths.
pub(super) const PREAMBLE: usize = 8 + 4 + 8 + 8;
/// Length of the checksum.
pub(super) const CHECKSUM: usize = 4;

/// Sizes of the arrays of a state.
pub(super) struct ArraySizes {
    /// Width and height of the rendered image, in pixels.
    pub width: usize,
    pub height: usize,
    /// Bytes per row of the store.
    pub row: usize,
    /// Bytes per pixel beside the store.
    per_pixel: usize,
    /// Number of tiles in x and y; `None` without an estimate.
    pub tiles: Option<[usize; 2]>,
}

impl ArraySizes {
    /// Computes the sizes that a header calls for; `None` if they overflow or the bounds are not within the film.
    pub fn new(header: &Header, layout: &Layout) -> Option<Self> {
        let [width, height] = header.metadata.resolution()?;
        // Image, variance, residual, failure map.
        let interim_bytes =
            |interim: &InterimHeader| 4 * (3 + 3 + 1 + usize::from(interim.interpolation_success.is_some()));
        let batch_bytes = match header.position {
            PositionHeader::Render { .. } => 4,
            PositionHeader::Plan | PositionHeader::Filter => 0,
        };
        Some(Self {
            width,
            height,
            row: Row::byte_len(width, layout, header.capacity)?,
            per_pixel: header.interim.as_ref().map_or(0, interim_bytes) + batch_bytes,
            tiles: header
                .interim
                .as_ref()
                .filter(|interim| interim.estimate.is_some())
                .map(|_| [width.div_ceil(TILE), height.div_ceil(TILE)]),
        })
    }

    /// Returns the bytes of all arrays; `None` if they overflow.
    pub fn bytes(&self) -> Option<usize> {
        let pixels = self.width.checked_mul(self.height)?;
        let tiles = self.tiles.map_or(Some(0), |[x, y]| x.checked_mul(y)?.checked_mul(4))?;
        self.row
            .checked_mul(self.height)?
            .checked_add(pixels.checked_mul(self.per_pixel)?)?
            .checked_add(tiles)
    }
}

/// Estimates the bytes of a state without its header; `None` if they overflow. `capacity` is the size of the
/// reservoir in sample vectors per pixel.
pub fn estimate_size(layout: &Layout, capacity: usize, pixels: usize) -> Option<usize> {
    /// Bytes per pixel of the latest filter pass and the unfinished batch.
    const BESIDE_STORE: usize = 4 * (8 + 1);
    Row::byte_len(1, layout, capacity)?.checked_add(BESIDE_STORE)?.checked_mul(pixels)
}
