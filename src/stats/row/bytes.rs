//! Converts rows of the store to bytes and back. Numbers are little endian; arrays follow each other
//! without headers.

use std::ops::Range;

use super::pixel_block::LARGEST_VALUE;
use super::{HalfRow, Row};
use crate::stats::layout::Layout;
use crate::stats::statistics_extent::StatisticsExtent;

/// Factor by which rounding may raise means and deviations above their bounds.
const ROUNDING: f64 = 1.5;

/// The reason why bytes are not a valid row of a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RowError {
    #[error("found a pixel whose valid and rejected samples do not add up to the samples taken")]
    Counts,
    #[error(
        "found a mean, a deviation or a sample that is not finite, too large, or negative where negative \
         values are invalid"
    )]
    Values,
}

/// A number of fixed size.
trait Number: Copy {
    const SIZE: usize;
    fn put(self, out: &mut [u8]);
    fn take(bytes: &[u8]) -> Self;
}

macro_rules! number {
    ($($kind:ty),*) => {$(
        impl Number for $kind {
            const SIZE: usize = size_of::<$kind>();
            #[inline]
            fn put(self, out: &mut [u8]) {
                out.copy_from_slice(&self.to_le_bytes());
            }
            #[inline]
            fn take(bytes: &[u8]) -> Self {
                let mut own = [0; size_of::<$kind>()];
                own.copy_from_slice(bytes);
                Self::from_le_bytes(own)
            }
        }
    )*};
}
number!(u32, f32, f64);

fn put<'b, T: Number>(values: &[T], out: &'b mut [u8]) -> &'b mut [u8] {
    let (now, rest) = out.split_at_mut(values.len() * T::SIZE);
    now.chunks_exact_mut(T::SIZE).zip(values).for_each(|(out, value)| value.put(out));
    rest
}

fn take<'b, T: Number>(values: &mut [T], bytes: &'b [u8]) -> &'b [u8] {
    let (now, rest) = bytes.split_at(values.len() * T::SIZE);
    values.iter_mut().zip(now.chunks_exact(T::SIZE)).for_each(|(value, bytes)| *value = T::take(bytes));
    rest
}

/// Bytes of the means and deviations of a dimension of a pixel, of both halves.
pub(in crate::stats) const MOMENTS_BYTES: usize = 2 * (size_of::<f64>() + size_of::<f32>());

/// Number of bytes of a pixel with the moments of some dimensions and some numbers in its reservoir.
fn pixel_bytes(dims: usize, reservoir: usize) -> Option<usize> {
    let moments = dims.checked_mul(MOMENTS_BYTES)?;
    let counts = (2 + 2) * size_of::<u32>();
    moments.checked_add(counts)?.checked_add(reservoir.checked_mul(size_of::<f32>())?)
}

/// Some pixels of a row, and which of their statistics are converted.
#[derive(Clone, Debug)]
pub(in crate::stats) struct Selection {
    pub pixels: Range<usize>,
    /// Dimensions whose moments are converted.
    pub dims: Range<usize>,
    /// Numbers of each pixel's reservoir; 0 leaves it out.
    pub reservoir: usize,
}

impl Selection {
    pub fn new(pixels: Range<usize>, extent: StatisticsExtent, layout: &Layout, capacity: usize) -> Self {
        let (dims, reservoir) = match extent {
            StatisticsExtent::Radiance => (layout.radiance(), 0),
            StatisticsExtent::All => (0..layout.len(), capacity * layout.len()),
        };
        Self { pixels, dims, reservoir }
    }

    /// Number of bytes of the selection.
    pub fn byte_len(&self) -> usize {
        let bytes = pixel_bytes(self.dims.len(), self.reservoir);
        self.pixels.len() * bytes.expect("what is in memory has a size")
    }

    /// Returns the places of the selected dimensions in planes of this stride.
    fn planes(&self, stride: usize) -> impl Iterator<Item = Range<usize>> + use<> {
        let Range { start, end } = self.pixels;
        self.dims.clone().map(move |dim| dim * stride + start..dim * stride + end)
    }

    fn vectors(&self) -> Range<usize> {
        self.pixels.start * self.reservoir..self.pixels.end * self.reservoir
    }
}

impl Row {
    /// Number of bytes of a row; `None` if it exceeds the address space.
    pub fn byte_len(width: usize, layout: &Layout, capacity: usize) -> Option<usize> {
        width.checked_mul(pixel_bytes(layout.len(), capacity.checked_mul(layout.len())?)?)
    }

    /// Writes, for all pixels: the samples taken; the rejected samples; for each half the counts, the
    /// means by dimension, and the sums of squared deviations by dimension; the reservoir.
    ///
    /// # Panics
    /// If the length of `out` is not [`Self::byte_len`].
    pub fn to_bytes(&self, out: &mut [u8]) {
        self.put(&self.everything(), out);
    }

    /// Writes a selection in the same order.
    ///
    /// # Panics
    /// If the length of `out` is not [`Selection::byte_len`].
    pub(in crate::stats) fn put(&self, selection: &Selection, out: &mut [u8]) {
        let pixels = selection.pixels.clone();
        let mut out = put(&self.next_index[pixels.clone()], out);
        out = put(&self.rejected[pixels.clone()], out);
        for half in &self.halves {
            out = put(&half.count[pixels.clone()], out);
            for plane in selection.planes(self.stride) {
                out = put(&half.mean[plane], out);
            }
            for plane in selection.planes(self.stride) {
                out = put(&half.m2[plane], out);
            }
        }
        out = put(&self.reservoir[selection.vectors()], out);
        assert!(out.is_empty(), "the output has the length of the selection");
    }

    /// Reads what [`Self::put`] wrote, from a row with the same layout and capacity.
    ///
    /// # Panics
    /// If the length of `bytes` is not [`Selection::byte_len`].
    pub(in crate::stats) fn take(&mut self, selection: &Selection, bytes: &[u8]) {
        let pixels = selection.pixels.clone();
        let mut bytes = take(&mut self.next_index[pixels.clone()], bytes);
        bytes = take(&mut self.rejected[pixels.clone()], bytes);
        for half in &mut self.halves {
            bytes = take(&mut half.count[pixels.clone()], bytes);
            for plane in selection.planes(self.stride) {
                bytes = take(&mut half.mean[plane], bytes);
            }
            for plane in selection.planes(self.stride) {
                bytes = take(&mut half.m2[plane], bytes);
            }
        }
        bytes = take(&mut self.reservoir[selection.vectors()], bytes);
        assert!(bytes.is_empty(), "the input has the length of the selection");
    }

    /// Selects all statistics of all pixels.
    fn everything(&self) -> Selection {
        Selection { pixels: 0..self.width, dims: 0..self.dims, reservoir: self.capacity * self.dims }
    }

    /// Reads bytes that [`Self::to_bytes`] wrote, into a row of the same size, layout and capacity.
    ///
    /// # Errors
    /// [`RowError`] for numbers that no samples can have given.
    ///
    /// # Panics
    /// If the length of `bytes` is not [`Self::byte_len`].
    pub fn read_bytes(&mut self, bytes: &[u8]) -> Result<(), RowError> {
        self.take(&self.everything(), bytes);
        self.check()
    }

    /// Checks that counts add up and that values are in range.
    fn check(&self) -> Result<(), RowError> {
        let total = |x: usize| {
            let parts = [self.rejected[x], self.halves[0].count[x], self.halves[1].count[x]];
            parts.into_iter().map(u64::from).sum::<u64>()
        };
        if (0..self.width).any(|x| total(x) != u64::from(self.next_index[x])) {
            return Err(RowError::Counts);
        }
        let largest = ROUNDING * f64::from(LARGEST_VALUE);
        let mut is_radiance = vec![false; self.dims];
        self.radiance.iter().for_each(|&dim| is_radiance[dim] = true);
        let stride = self.stride.max(1);
        let means_in_range = |half: &HalfRow| {
            half.mean.chunks_exact(stride).zip(&is_radiance).all(|(means, &is_radiance)| {
                means.iter().zip(&half.count[..self.width]).all(|(mean, &count)| {
                    let most = if count == 0 { 0.0 } else { largest };
                    let least = if is_radiance { 0.0 } else { -most };
                    (least..=most).contains(mean)
                })
            })
        };
        let deviations_in_range = |half: &HalfRow| {
            half.m2.chunks_exact(stride).all(|m2s| {
                m2s.iter().zip(&half.count[..self.width]).all(|(&m2, &count)| {
                    (0.0..=f64::from(count) * largest * largest).contains(&f64::from(m2))
                })
            })
        };
        let moments_in_range =
            self.halves.iter().all(|half| means_in_range(half) && deviations_in_range(half));
        let is_valid = |sample: &[f32]| {
            let values = sample.iter().zip(&is_radiance);
            values.into_iter().all(|(v, &is_radiance)| v.abs() <= LARGEST_VALUE && !(is_radiance && *v < 0.0))
        };
        if !moments_in_range || !self.reservoir.chunks(self.dims.max(1)).all(is_valid) {
            return Err(RowError::Values);
        }
        Ok(())
    }
}
