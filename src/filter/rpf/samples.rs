//! The samples of all pixels, and the colours that they carry from pass to pass.

use crate::filter::padded::Padded;
use crate::image::Planes;
use crate::stats::Store;

/// What is averaged of a sample: its colour c′; the same of the half of the samples that it belongs to, 0
/// in the other half; and how much of it is of that half. So the result of each half is known, with the
/// weights of both. The last is not used.
pub(super) type Value = [f32; 8];

const HALF_COLOUR: usize = 3;
const HALF_SHARE: usize = 6;

/// The samples that a store keeps.
pub(super) struct Samples<'a> {
    width: usize,
    dims: usize,
    radiance: usize,
    /// Sample vectors of each pixel, one after the other.
    pixels: Vec<&'a [f32]>,
    /// Number of the first sample of each pixel, and of all.
    starts: Vec<usize>,
}

impl<'a> Samples<'a> {
    pub fn of(store: &'a Store) -> Self {
        let dims = store.layout().len();
        let kept = |x: usize, y: usize| store.rows()[y].reservoir(x);
        let pixels: Vec<&[f32]> =
            (0..store.height()).flat_map(|y| (0..store.width()).map(move |x| kept(x, y))).collect();
        let mut total = 0;
        let mut starts = vec![0];
        starts.extend(pixels.iter().map(|pixel| {
            total += pixel.len() / dims;
            total
        }));
        Self { width: store.width(), dims, radiance: store.layout().radiance().start, pixels, starts }
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.pixels.len() / self.width.max(1)
    }

    pub fn count(&self, x: usize, y: usize) -> usize {
        let pixel = y * self.width + x;
        self.starts[pixel + 1] - self.starts[pixel]
    }

    /// Samples of a pixel, on average.
    pub fn mean_count(&self) -> f32 {
        self.starts[self.pixels.len()] as f32 / self.pixels.len().max(1) as f32
    }

    /// Samples of the pixel that has most.
    pub fn most(&self) -> usize {
        self.starts.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
    }

    /// Numbers of a pixel's samples.
    #[inline]
    pub fn of_pixel(&self, x: usize, y: usize) -> std::ops::Range<usize> {
        let pixel = y * self.width + x;
        self.starts[pixel]..self.starts[pixel + 1]
    }

    /// One sample vector of a pixel, which is counted row by row.
    #[inline]
    pub fn sample(&self, pixel: usize, slot: usize) -> &'a [f32] {
        &self.pixels[pixel][slot * self.dims..][..self.dims]
    }

    /// The samples' colours as rendered.
    pub fn values(&self) -> Vec<Value> {
        let mut values = Vec::with_capacity(self.starts[self.pixels.len()]);
        for (pixel, samples) in self.pixels.iter().enumerate() {
            let (x, y) = (pixel % self.width, pixel / self.width);
            for (slot, sample) in samples.chunks_exact(self.dims).enumerate() {
                // In a chequerboard, so that both halves have some of each region at any count.
                let share = f32::from((x + y + slot).is_multiple_of(2));
                let mut value = [0.0; 8];
                for c in 0..3 {
                    let colour = sample[self.radiance + c];
                    (value[c], value[HALF_COLOUR + c]) = (colour, share * colour);
                }
                value[HALF_SHARE] = share;
                values.push(value);
            }
        }
        values
    }

    /// Cuts what belongs to samples into the rows of the image.
    pub fn rows_of<'v, T>(&self, mut values: &'v mut [T]) -> Vec<&'v mut [T]> {
        let mut rows = Vec::with_capacity(self.height());
        for y in 0..self.height() {
            let row = self.starts[(y + 1) * self.width] - self.starts[y * self.width];
            let (own, rest) = values.split_at_mut(row);
            rows.push(own);
            values = rest;
        }
        rows
    }

    /// The mean of each pixel's samples (a box filter), times `exposure`, and the difference of the halves:
    /// 3 planes each. A pixel without samples looks like the nearest ones with some.
    pub fn pixels(&self, values: &[Value], exposure: f32) -> Padded {
        let mut planes = Planes::new(self.width, self.height(), 6);
        let count = self.pixels.len();
        for pixel in 0..count {
            let mean = self.mean_around(values, pixel);
            let share = mean[HALF_SHARE];
            for c in 0..3 {
                planes.data_mut()[c * count + pixel] = exposure * mean[c];
                if 0.0 < share && share < 1.0 {
                    let a = mean[HALF_COLOUR + c];
                    let difference = a / share - (mean[c] - a) / (1.0 - share);
                    planes.data_mut()[(3 + c) * count + pixel] = exposure * difference;
                }
            }
        }
        Padded::from_planes(&planes, 0, 0.0)
    }

    /// Mean over a pixel's samples, or where it has none over those of the smallest square around it that
    /// has some.
    fn mean_around(&self, values: &[Value], pixel: usize) -> Value {
        let (x, y) = (pixel % self.width, pixel / self.width);
        for radius in 0..self.width.max(self.height()) {
            let mut around = Vec::new();
            for yj in y.saturating_sub(radius)..=(y + radius).min(self.height() - 1) {
                let (left, right) = (x.saturating_sub(radius), (x + radius).min(self.width - 1));
                around
                    .extend_from_slice(&values[self.of_pixel(left, yj).start..self.of_pixel(right, yj).end]);
            }
            if !around.is_empty() {
                return mean(&around);
            }
        }
        [0.0; 8]
    }
}

/// The mean; exactly the value where all are equal.
pub(super) fn mean(values: &[Value]) -> Value {
    let mut sum = [0.0; 8];
    for value in values {
        (0..8).for_each(|c| sum[c] += value[c] - values[0][c]);
    }
    std::array::from_fn(|c| values[0][c] + sum[c] / values.len() as f32)
}
