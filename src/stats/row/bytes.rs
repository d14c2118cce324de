//! Converts rows of the store to bytes and back. Numbers are little endian; arrays follow each other
//! without headers.

use super::pixel_block::LARGEST_VALUE;
use super::{HalfRow, Row};

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
    pub fn byte_len(width: usize, dims: usize, capacity: usize) -> Option<usize> {
        let moments = dims.checked_mul(2 * 2 * size_of::<f64>())?;
        let counts = (2 + 2) * size_of::<u32>();
        let reservoir = capacity.checked_mul(dims)?.checked_mul(size_of::<f32>())?;
        width.checked_mul(moments.checked_add(counts)?.checked_add(reservoir)?)
    }

    /// Writes, for all pixels: the samples taken; the rejected samples; for each half the counts, the
    /// means by dimension, and the sums of squared deviations by dimension; the reservoir.
    ///
    /// # Panics
    /// If the length of `out` is not [`Self::byte_len`].
    pub fn to_bytes(&self, out: &mut [u8]) {
        let mut out = put(&self.next_index[..self.width], out);
        out = put(&self.rejected[..self.width], out);
        for half in &self.halves {
            out = put(&half.count[..self.width], out);
            for plane in [&half.mean, &half.m2] {
                for values in plane.chunks_exact(self.stride.max(1)) {
                    out = put(&values[..self.width], out);
                }
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
        for half in &mut self.halves {
            bytes = take(&mut half.count[..self.width], bytes);
            for plane in [&mut half.mean, &mut half.m2] {
                for values in plane.chunks_exact_mut(self.stride.max(1)) {
                    bytes = take(&mut values[..self.width], bytes);
                }
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
        let in_range = |half: &HalfRow| {
            let planes =
                half.mean.chunks_exact(self.stride.max(1)).zip(half.m2.chunks_exact(self.stride.max(1)));
            planes.zip(&is_radiance).all(|((means, m2s), &is_radiance)| {
                means.iter().zip(m2s).zip(&half.count[..self.width]).all(|((&mean, m2), &count)| {
                    let most = if count == 0 { 0.0 } else { largest };
                    let least = if is_radiance { 0.0 } else { -most };
                    (least..=most).contains(&mean)
                        && (0.0..=f64::from(count) * largest * largest).contains(m2)
                })
            })
        };
        let is_valid = |sample: &[f32]| {
            let values = sample.iter().zip(&is_radiance);
            values.into_iter().all(|(v, &is_radiance)| v.abs() <= LARGEST_VALUE && !(is_radiance && *v < 0.0))
        };
        if !self.halves.iter().all(in_range) || !self.reservoir.chunks(self.dims.max(1)).all(is_valid) {
            return Err(RowError::Values);
        }
        Ok(())
    }
}
