//! The samples of all pixels, and the filtered colours of each sample, which the passes update.

use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::image::Planes;
use crate::stats::Store;

/// The filtered values of a sample: its colour c′, the same if it belongs to the first half of the samples (0
/// otherwise), and the fraction of it that comes from the first half. From these the image of each half
/// follows, with the weights of all samples. The last value is padding.
pub type Value = [f32; 8];

const HALF_COLOUR: usize = 3;
const HALF_FRACTION: usize = 6;

/// The samples in the reservoirs of a store.
pub struct Samples<'a> {
    width: usize,
    dims: usize,
    radiance: usize,
    /// Sample vectors of each pixel, side by side.
    pixels: Vec<&'a [f32]>,
    /// Index of the first sample of each pixel, and the total number.
    starts: Vec<usize>,
}

impl<'a> Samples<'a> {
    pub fn from_store(store: &'a Store) -> Self {
        let dims = store.layout().len();
        let reservoir = |x: usize, y: usize| store.rows()[y].reservoir(x);
        let pixels: Vec<&[f32]> =
            (0..store.height()).flat_map(|y| (0..store.width()).map(move |x| reservoir(x, y))).collect();
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

    /// Mean number of samples of a pixel.
    pub fn mean_count(&self) -> f32 {
        self.starts[self.pixels.len()] as f32 / self.pixels.len().max(1) as f32
    }

    /// Maximum number of samples of a pixel.
    pub fn max_count(&self) -> usize {
        self.starts.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
    }

    /// Indices of a pixel's samples among all.
    #[inline]
    pub fn ids(&self, x: usize, y: usize) -> std::ops::Range<usize> {
        let pixel = y * self.width + x;
        self.starts[pixel]..self.starts[pixel + 1]
    }

    /// Returns a sample vector of a pixel, which is given by its index.
    #[inline]
    pub fn sample(&self, pixel: usize, slot: usize) -> &'a [f32] {
        &self.pixels[pixel][slot * self.dims..][..self.dims]
    }

    /// Returns the unfiltered values of all samples.
    pub fn values(&self) -> Vec<Value> {
        let mut values = Vec::with_capacity(self.starts[self.pixels.len()]);
        for (pixel, samples) in self.pixels.iter().enumerate() {
            let (x, y) = (pixel % self.width, pixel / self.width);
            for (slot, sample) in samples.chunks_exact(self.dims).enumerate() {
                // A chequerboard gives both halves samples of every region at any count.
                let fraction = f32::from((x + y + slot).is_multiple_of(2));
                let mut value = [0.0; 8];
                for c in 0..3 {
                    let colour = sample[self.radiance + c];
                    (value[c], value[HALF_COLOUR + c]) = (colour, fraction * colour);
                }
                value[HALF_FRACTION] = fraction;
                values.push(value);
            }
        }
        values
    }

    /// Splits values of all samples into those of each row of the image.
    pub fn split_rows<'v, T>(&self, mut values: &'v mut [T]) -> Vec<&'v mut [T]> {
        let mut rows = Vec::with_capacity(self.height());
        for y in 0..self.height() {
            let row = self.starts[(y + 1) * self.width] - self.starts[y * self.width];
            let (own, rest) = values.split_at_mut(row);
            rows.push(own);
            values = rest;
        }
        rows
    }

    /// Returns the mean of each pixel's samples (a box filter) and the difference of the halves, 3 planes
    /// each, multiplied by `scale`. Pixels without samples get the mean of the nearest pixels with samples.
    pub fn pixel_means(&self, values: &[Value], scale: f32) -> InterleavedPlanes {
        let mut planes = Planes::new(self.width, self.height(), 6);
        let count = self.pixels.len();
        for pixel in 0..count {
            let mean = self.mean_around(values, pixel);
            let fraction = mean[HALF_FRACTION];
            for c in 0..3 {
                planes.data_mut()[c * count + pixel] = scale * mean[c];
                if 0.0 < fraction && fraction < 1.0 {
                    let a = mean[HALF_COLOUR + c];
                    let difference = a / fraction - (mean[c] - a) / (1.0 - fraction);
                    planes.data_mut()[(3 + c) * count + pixel] = scale * difference;
                }
            }
        }
        InterleavedPlanes::from_planes(&planes, 0, 0.0)
    }

    /// Returns the mean over a pixel's samples, or over those of the smallest square around it that has samples.
    fn mean_around(&self, values: &[Value], pixel: usize) -> Value {
        let (x, y) = (pixel % self.width, pixel / self.width);
        for radius in 0..self.width.max(self.height()) {
            let mut around = Vec::new();
            for yj in y.saturating_sub(radius)..=(y + radius).min(self.height() - 1) {
                let (left, right) = (x.saturating_sub(radius), (x + radius).min(self.width - 1));
                around.extend_from_slice(&values[self.ids(left, yj).start..self.ids(right, yj).end]);
            }
            if !around.is_empty() {
                return mean(&around);
            }
        }
        [0.0; 8]
    }
}

/// Returns the mean; exactly the common value if all are equal.
pub fn mean(values: &[Value]) -> Value {
    let mut sum = [0.0; 8];
    for value in values {
        (0..8).for_each(|c| sum[c] += value[c] - values[0][c]);
    }
    std::array::from_fn(|c| values[0][c] + sum[c] / values.len() as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::Layout;

    const WIDTH: usize = 6;
    const HEIGHT: usize = 4;

    fn count(x: usize, y: usize) -> u32 {
        if (1..4).contains(&x) && y < 3 { 0 } else { (x + 2 * y) as u32 % 5 }
    }

    /// The colour of sample `index` of a pixel.
    fn colour(x: usize, y: usize, index: usize) -> f32 {
        (100 * y + 10 * x + index) as f32
    }

    fn make() -> Store {
        let layout = Layout::with_blocks(|_| true);
        store(WIDTH, HEIGHT, layout.clone(), count, |x, y, index, rng| {
            wall(&layout, x, y, [colour(x, y, index as usize), 1.0, 0.5], rng)
        })
    }

    fn pixels() -> impl Iterator<Item = (usize, usize)> {
        (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)))
    }

    #[test]
    fn samples_are_indexed_pixel_by_pixel() {
        let store = make();
        let samples = Samples::from_store(&store);
        assert_eq!((samples.width(), samples.height(), samples.max_count()), (WIDTH, HEIGHT, 4));
        let values = samples.values();
        let mut next = 0;
        for (x, y) in pixels() {
            let own = count(x, y) as usize;
            assert_eq!(samples.count(x, y), own);
            assert_eq!(samples.ids(x, y), next..next + own);
            for slot in 0..own {
                let radiance = store.layout().radiance().start;
                assert_eq!(samples.sample(y * WIDTH + x, slot)[radiance], colour(x, y, slot));
                let [red, green, blue, half_red, half_green, half_blue, fraction, _] = values[next + slot];
                assert_eq!([red, green, blue], [colour(x, y, slot), 1.0, 0.5]);
                let first = (x + y + slot) % 2 == 0;
                let half = if first { [red, green, blue] } else { [0.0; 3] };
                assert_eq!(([half_red, half_green, half_blue], fraction), (half, f32::from(first)));
            }
            next += own;
        }
        assert_eq!(values.len(), next);
        assert!((samples.mean_count() - next as f32 / 24.0).abs() < 1e-6);
    }

    #[test]
    fn rows_hold_the_values_of_their_pixels() {
        let store = make();
        let samples = Samples::from_store(&store);
        let mut values = samples.values();
        let all = values.clone();
        let rows = samples.split_rows(&mut values);
        assert_eq!(rows.len(), HEIGHT);
        for (y, row) in rows.iter().enumerate() {
            let span = samples.ids(0, y).start..samples.ids(WIDTH - 1, y).end;
            assert_eq!(**row, all[span]);
        }
    }

    #[test]
    fn pixel_means_and_differences_of_halves_agree_with_the_definition() {
        let store = make();
        let samples = Samples::from_store(&store);
        let found = samples.pixel_means(&samples.values(), 2.0);
        for (x, y) in pixels() {
            let reach = |radius: usize| {
                pixels()
                    .filter(move |(xj, yj)| xj.abs_diff(x) <= radius && yj.abs_diff(y) <= radius)
                    .flat_map(|(x, y)| (0..count(x, y) as usize).map(move |slot| (x, y, slot)))
                    .collect::<Vec<_>>()
            };
            let from = (0..WIDTH).map(reach).find(|from| !from.is_empty()).expect("some pixels have samples");
            let mean = |half: Option<usize>| {
                let values: Vec<f32> = from
                    .iter()
                    .filter(|(x, y, slot)| half.is_none_or(|half| (x + y + slot) % 2 == half))
                    .map(|&(x, y, slot)| colour(x, y, slot))
                    .collect();
                (!values.is_empty()).then(|| values.iter().sum::<f32>() / values.len() as f32)
            };
            let expected = 2.0 * mean(None).expect("not empty");
            let close = |found: f32, expected: f32| (found - expected).abs() < 1e-2;
            assert!(close(found.at(0, x, y), expected), "{x} {y}: {} for {expected}", found.at(0, x, y));
            let difference = mean(Some(0)).zip(mean(Some(1))).map_or(0.0, |(a, b)| 2.0 * (a - b));
            assert!(close(found.at(3, x, y), difference), "{x} {y}: {}", found.at(3, x, y));
            assert!(close(found.at(1, x, y), 2.0) && close(found.at(2, x, y), 1.0));
        }
    }

    #[test]
    fn the_mean_of_equal_values_is_exact_and_images_without_samples_are_black() {
        assert_eq!(mean(&[[0.1; 8]; 7]), [0.1; 8]);
        assert_eq!(mean(&[[1.0; 8], [2.0; 8], [6.0; 8]]), [3.0; 8]);
        let layout = Layout::with_blocks(|_| false);
        let empty = Store::new(3, 2, layout, 4, 1);
        let samples = Samples::from_store(&empty);
        assert!(samples.pixel_means(&[], 1.0).to_planes().data().iter().all(|&v| v == 0.0));
        assert_eq!((samples.mean_count(), samples.max_count()), (0.0, 0));
    }
}
