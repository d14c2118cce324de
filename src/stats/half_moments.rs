//! Makes a store of buffers that another program has reduced its samples to: counts, means and variances of two
//! independent halves of the samples of each pixel.
//!
//! Such a store has no sample vectors, so that denoisers which read them cannot filter it.

use super::columns::Columns;
use super::row::LARGEST_VALUE;
use super::store::Store;

/// The moments of half the samples of every pixel, row by row from the top left.
#[derive(Clone, Copy, Debug)]
pub struct HalfMoments<'a> {
    /// Number of samples, `[pixel]`.
    pub counts: &'a [u32],
    /// Mean of the samples, `[pixel][column]`.
    pub means: &'a [f32],
    /// Unbiased variance of the samples, `[pixel][column]`.
    pub variances: &'a [f32],
}

/// Buffers that make no store.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HalfMomentsError {
    #[error("{name}: found {found} values; accepted are {accepted}")]
    Length { name: &'static str, found: usize, accepted: usize },
    #[error("{name}: found {found}; accepted are {accepted}")]
    Value { name: &'static str, found: f32, accepted: &'static str },
    #[error("counts: found {found}; accepted are at most {MAX_COUNT}")]
    Count { found: u32 },
}

/// The largest number of samples of half a pixel.
const MAX_COUNT: u32 = u32::MAX / 4;

impl Store {
    /// Creates a store from the moments of both halves.
    ///
    /// # Errors
    /// Buffers of another length, values that are not finite, negative variances or radiance.
    pub fn from_half_moments(
        width: usize,
        height: usize,
        columns: &Columns,
        halves: &[HalfMoments; 2],
        seed: u64,
    ) -> Result<Self, HalfMomentsError> {
        halves.iter().try_for_each(|half| half.validate(width * height, columns))?;
        let mut store = Self::new(width, height, columns.layout().clone(), 0, seed);
        let count = columns.count();
        for (y, row) in store.rows_mut().iter_mut().enumerate() {
            for (x, (half, moments)) in
                (0..width).flat_map(|x| halves.iter().enumerate().map(move |h| (x, h)))
            {
                let pixel = y * width + x;
                // A pixel without samples has no moments.
                if moments.counts[pixel] > 0 {
                    let [mean, variance] =
                        [moments.means, moments.variances].map(|values| &values[pixel * count..][..count]);
                    let values = columns.arrange_moments(x, y, mean, variance);
                    row.set_half(x, half, moments.counts[pixel], values);
                }
            }
        }
        Ok(store)
    }
}

impl HalfMoments<'_> {
    fn validate(&self, pixels: usize, columns: &Columns) -> Result<(), HalfMomentsError> {
        // Check the lengths
        let values = pixels * columns.count();
        for (name, found, accepted) in [
            ("counts", self.counts.len(), pixels),
            ("means", self.means.len(), values),
            ("variances", self.variances.len(), values),
        ] {
            if found != accepted {
                return Err(HalfMomentsError::Length { name, found, accepted });
            }
        }

        // Check the values
        if let Some(&found) = self.counts.iter().find(|&&count| count > MAX_COUNT) {
            return Err(HalfMomentsError::Count { found });
        }
        let find = |name, values: &[f32], accepted, is_valid: fn(f32) -> bool| {
            let found = values.iter().find(|&&value| !is_valid(value));
            found.map_or(Ok(()), |&found| Err(HalfMomentsError::Value { name, found, accepted }))
        };
        find("means", self.means, "numbers from -1e15 to 1e15", |value| value.abs() <= LARGEST_VALUE)?;
        find("variances", self.variances, "numbers from 0 to 1e30", |value| {
            value >= 0.0 && value.sqrt() <= LARGEST_VALUE
        })?;
        let layout = columns.layout();
        let is_radiance = |dim: &usize| layout.colour().contains(dim) || layout.radiance().contains(dim);
        let mut radiance = self.means.chunks_exact(columns.count()).flat_map(|mean| {
            columns
                .arrange(0, 0, mean)
                .enumerate()
                .filter(|(dim, _)| is_radiance(dim))
                .map(|(_, value)| value)
        });
        radiance.find(|&value| value < 0.0).map_or(Ok(()), |found| {
            Err(HalfMomentsError::Value { name: "means", found, accepted: "numbers from 0 up for radiance" })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Planes;
    use crate::stats::Part;

    #[test]
    fn moments_are_those_that_were_given() {
        // Reduce samples to moments
        let columns = Columns::new(&["R", "G", "B", "time"]).unwrap();
        let (width, height) = (19, 2);
        let mut samples = Store::new(width, height, columns.layout().clone(), 0, 0);
        for i in 0..width * height * 7 {
            let (pixel, value) = (i % (width * height), (i * 31 % 17) as f32);
            let (x, y) = (pixel % width, pixel / width);
            samples.push(x, y, &[x as f32 + 0.5, y as f32 + 0.5, value, 2.0 * value, 1.0, 0.25]);
        }
        let interleave = |planes: Planes| -> Vec<f32> {
            let values = |i| (0..4).map(move |dim| (dim, i));
            (0..width * height).flat_map(values).map(|(dim, i)| planes.plane(dim)[i]).collect()
        };
        let buffers = [0, 1].map(|half| {
            let part = Part::Half(half);
            let (means, variances) = (samples.means(part, 2..6), samples.variances(part, 2..6));
            (samples.counts(part), interleave(means), interleave(variances))
        });

        // Make a store of them
        let halves =
            buffers.each_ref().map(|(counts, means, variances)| HalfMoments { counts, means, variances });
        let store = Store::from_half_moments(width, height, &columns, &halves, 0).unwrap();
        assert_eq!(store.samples_taken(), samples.samples_taken());
        for part in [Part::Half(0), Part::Half(1), Part::Whole] {
            assert_eq!(store.counts(part), samples.counts(part));
            let pairs = [
                (store.means(part, 0..6), samples.means(part, 0..6)),
                (store.variances(part, 2..6), samples.variances(part, 2..6)),
            ];
            for (found, expected) in pairs {
                let is_close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-4 * b.abs().max(1.0);
                assert!(found.data().iter().zip(expected.data()).all(is_close));
            }
        }
    }

    #[test]
    fn buffers_that_make_no_store_are_errors() {
        let columns = Columns::new(&["R", "G", "B"]).unwrap();
        let error = |counts: &[u32], means: &[f32], variances: &[f32]| {
            let half = HalfMoments { counts, means, variances };
            Store::from_half_moments(1, 1, &columns, &[half, half], 0).unwrap_err().to_string()
        };
        assert_eq!(error(&[1, 1], &[1.0; 3], &[1.0; 3]), "counts: found 2 values; accepted are 1");
        assert_eq!(error(&[1], &[1.0; 4], &[1.0; 3]), "means: found 4 values; accepted are 3");
        assert!(error(&[1], &[f32::NAN; 3], &[1.0; 3]).starts_with("means: found NaN"));
        assert!(error(&[1], &[-1.0; 3], &[1.0; 3]).starts_with("means: found -1"));
        assert!(error(&[1], &[1.0; 3], &[-1.0; 3]).starts_with("variances: found -1"));
        assert!(error(&[u32::MAX], &[1.0; 3], &[1.0; 3]).starts_with("counts: found 4294967295"));
    }
}
