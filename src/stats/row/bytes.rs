//! Converts rows of the store to bytes and back. Numbers are little endian; arrays follow each other
//! without headers.

use super::pixel_block::LARGEST_VALUE;
use super::{HalfRow, Row, deviation_planes};
use crate::stats::layout::Layout;
use crate::stats::part::Part;

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

impl Row {
    /// Number of bytes of a row; `None` if it exceeds the address space.
    pub fn byte_len(width: usize, layout: &Layout, capacity: usize) -> Option<usize> {
        let dims = layout.len();
        let moments = dims.checked_mul((2 + deviation_planes(layout)) * size_of::<f64>())?;
        let counts = (2 + 2) * size_of::<u32>();
        let reservoir = capacity.checked_mul(dims)?.checked_mul(size_of::<f32>())?;
        width.checked_mul(moments.checked_add(counts)?.checked_add(reservoir)?)
    }

    /// Writes, for all pixels: the samples taken; the rejected samples; for each half the counts, the
    /// means by dimension, and the sums of squared deviations by dimension, which the first half has for both if they are
    /// kept together; the reservoir.
    ///
    /// # Panics
    /// If the length of `out` is not [`Self::byte_len`].
    pub fn to_bytes(&self, out: &mut [u8]) {
        let mut out = put(&self.next_index[..self.width], out);
        out = put(&self.rejected[..self.width], out);
        let stride = self.stride.max(1);
        for (h, half) in self.halves.iter().enumerate() {
            out = put(&half.count[..self.width], out);
            let deviations = self.deviations.get(h).map_or(&[][..], |plane| plane);
            for values in half.mean.chunks_exact(stride).chain(deviations.chunks_exact(stride)) {
                out = put(&values[..self.width], out);
            }
        }
        out = put(&self.reservoir, out);
        assert!(out.is_empty(), "the output has the length of a row");
    }

    /// Reads bytes that [`Self::to_bytes`] wrote, into a row of the same size, layout and capacity.
    ///
    /// # Errors
    /// [`RowError`] for numbers that no samples can have given.
    ///
    /// # Panics
    /// If the length of `bytes` is not [`Self::byte_len`].
    pub fn read_bytes(&mut self, bytes: &[u8]) -> Result<(), RowError> {
        let mut bytes = take(&mut self.next_index[..self.width], bytes);
        bytes = take(&mut self.rejected[..self.width], bytes);
        let stride = self.stride.max(1);
        for (h, half) in self.halves.iter_mut().enumerate() {
            bytes = take(&mut half.count[..self.width], bytes);
            let deviations = self.deviations.get_mut(h).map_or(&mut [][..], |plane| plane);
            for values in half.mean.chunks_exact_mut(stride).chain(deviations.chunks_exact_mut(stride)) {
                bytes = take(&mut values[..self.width], bytes);
            }
        }
        bytes = take(&mut self.reservoir, bytes);
        assert!(bytes.is_empty(), "the input has the length of a row");
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
        let deviations_in_range = |(plane, m2s): (usize, &Vec<f64>)| {
            let part = if self.deviations.len() == 1 { Part::Whole } else { Part::Half(plane) };
            m2s.chunks_exact(stride).all(|m2s| {
                m2s[..self.width]
                    .iter()
                    .enumerate()
                    .all(|(x, m2)| (0.0..=f64::from(self.count(x, part)) * largest * largest).contains(m2))
            })
        };
        let moments_in_range = self.halves.iter().all(means_in_range)
            && self.deviations.iter().enumerate().all(deviations_in_range);
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
