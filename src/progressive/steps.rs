//! Steps of a batch: any fraction of it is spread over the image as the whole is.
//!
//! Ordered dithering (Bayer 1973) decides when a pixel gets its samples, so that a batch that the clock cuts short leaves
//! no visible border between the pixels that it reached and the others.

use rayon::prelude::*;

use crate::stats::{PIXEL_BLOCK, Store};

/// Side of the dither matrix.
const SIDE: usize = 8;
/// Spreads the turns of pixels with the same entry of the matrix.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;

/// How fine the dithering is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Grain {
    /// Single pixels: the first samples are an image as soon as possible.
    Pixel,
    /// Pixels whose samples the store takes in together: with single pixels, small steps are half as fast.
    Block,
}

/// Returns the samples per pixel that lead from the fraction `from` of a batch to the fraction `to`; from 0 to 1 they
/// are `counts`. Even counts grow by pairs, so that both halves of a pixel grow alike.
pub(super) fn between(counts: &[u32], store: &Store, grain: Grain, from: f64, to: f64) -> Vec<u32> {
    let width = store.width().max(1);
    let side = if grain == Grain::Block { PIXEL_BLOCK } else { 1 };
    let part = |n: u32, turn: f64, fraction: f64| {
        let unit = 2 - n % 2;
        let units = n / unit;
        unit * ((f64::from(units) * fraction + turn) as u32).min(units)
    };
    let mut step = vec![0; counts.len()];
    step.par_chunks_mut(width).zip(counts.par_chunks(width)).enumerate().for_each(|(y, (step, counts))| {
        let groups = step.chunks_mut(side).zip(counts.chunks(side)).enumerate();
        for (x, (step, counts)) in groups {
            let turn = turn(x, y);
            for (step, &n) in step.iter_mut().zip(counts) {
                *step = part(n, turn, to) - part(n, turn, from);
            }
        }
    });
    step
}

/// When a pixel's turn comes: uniform in [0, 1), the larger the earlier.
pub(super) fn turn(x: usize, y: usize) -> f64 {
    // Bits of x ⊕ y and y, interleaved, the lowest first.
    let (a, b) = ((x ^ y) % SIDE, y % SIDE);
    let matrix = (0..3).fold(0, |matrix, bit| matrix << 2 | (a >> bit & 1) << 1 | (b >> bit & 1));
    let within = ((x / SIDE + 61 * (y / SIDE)) as f64 * GOLDEN_RATIO).fract();
    (matrix as f64 + within) / (SIDE * SIDE) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Layout;

    fn store(side: usize) -> Store {
        Store::new(side, side, Layout::with_blocks(|_| false), 0, 0)
    }

    #[test]
    fn steps_add_up_to_the_batch_whatever_their_size() {
        let store = store(16);
        let counts: Vec<u32> = (0..256).map(|i| i % 23).collect();
        let mut sum = vec![0; 256];
        for pair in [0.0, 0.01, 0.013, 0.2, 0.9, 1.0].windows(2) {
            let step = between(&counts, &store, Grain::Block, pair[0], pair[1]);
            sum.iter_mut().zip(&step).for_each(|(sum, n)| *sum += n);
        }
        assert_eq!(sum, counts);
    }

    #[test]
    fn a_sixteenth_of_a_batch_reaches_every_block_of_eight_by_eight_alike() {
        let step = between(&[1; 64 * 64], &store(64), Grain::Pixel, 0.0, 1.0 / 16.0);
        for block in 0..64 {
            let (x0, y0) = (block % 8 * 8, block / 8 * 8);
            let n: u32 = (0..64).map(|i| step[(y0 + i / 8) * 64 + x0 + i % 8]).sum();
            assert_eq!(n, 4);
            let rows = (0..8).filter(|y| (0..8).any(|x| step[(y0 + y) * 64 + x0 + x] > 0)).count();
            assert!(rows >= 2, "not all in one row");
        }
    }

    #[test]
    fn even_counts_grow_by_pairs() {
        let step = between(&[6; 256], &store(16), Grain::Pixel, 0.0, 0.4);
        assert!(step.iter().all(|n| n % 2 == 0));
        let sum: u32 = step.iter().sum();
        assert!((sum as f64 / (256.0 * 6.0) - 0.4).abs() < 0.02, "{sum}");
    }
}
