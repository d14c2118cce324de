//! Whether a store has pixels and fits in memory, before any is taken: for programs that push samples of their own.

use super::memory_budget::{MemoryError, fits_in_memory};
use super::settings::Settings;
use crate::scene::film::{MAX_PIXELS, MAX_SIDE};
use crate::stats::Layout;

/// Why no store of a size can be made.
#[derive(Debug, thiserror::Error)]
pub enum StoreSizeError {
    #[error("size: found {0}x{1}; accepted are sides from 1 to {MAX_SIDE} and at most {MAX_PIXELS} pixels")]
    Size(usize, usize),
    #[error(transparent)]
    Memory(#[from] MemoryError),
}

/// Checks the size of a store, in pixels, with up to `reservoir` sample vectors of each pixel.
///
/// # Errors
/// No pixels, too many of them, or too little memory.
pub fn check_store_size(
    layout: &Layout,
    (width, height): (usize, usize),
    reservoir: usize,
) -> Result<(), StoreSizeError> {
    let is_accepted = |side: usize| (1..=MAX_SIDE as usize).contains(&side);
    if !is_accepted(width) || !is_accepted(height) || (width * height) as u64 > MAX_PIXELS {
        return Err(StoreSizeError::Size(width, height));
    }
    let settings = Settings { reservoir, ..Settings::default() };
    Ok(fits_in_memory(layout, &settings, (width, height), false, 1)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stores_without_pixels_or_beyond_any_memory_are_refused() {
        let layout = Layout::with_blocks(|_| false);
        let check = |size, reservoir| check_store_size(&layout, size, reservoir);
        check((1, 1), 0).unwrap();
        for (width, height) in [(0, 5), (5, 0), (usize::MAX, 1), (MAX_SIDE as usize, MAX_SIDE as usize)] {
            assert!(matches!(check((width, height), 0), Err(StoreSizeError::Size(..))), "{width}x{height}");
        }
        assert!(matches!(check((4000, 4000), 1 << 40), Err(StoreSizeError::Memory(_))));
        assert!(matches!(check((4000, 4000), usize::MAX), Err(StoreSizeError::Memory(_))));
    }
}
