//! The sample vectors in the reservoirs of all pixels, found by one look-up.

use rayon::prelude::*;

use crate::stats::Store;

/// The reservoirs of a store.
pub struct Reservoirs<'a> {
    width: usize,
    /// Length of a sample vector.
    dims: usize,
    pixels: Vec<Reservoir<'a>>,
}

/// The sample vectors of a pixel.
#[derive(Clone, Copy)]
pub struct Reservoir<'a> {
    /// The vectors, concatenated.
    values: &'a [f32],
    /// Number of vectors.
    count: u32,
}

impl<'a> Reservoirs<'a> {
    pub fn new(store: &'a Store) -> Self {
        let (width, dims) = (store.width(), store.layout().len());
        let reservoir = |i: usize| {
            let values = store.rows()[i / width].reservoir(i % width);
            Reservoir { values, count: (values.len() / dims) as u32 }
        };
        Self { width, dims, pixels: (0..store.pixels()).into_par_iter().map(reservoir).collect() }
    }

    /// Returns the index of a pixel.
    #[inline]
    pub fn pixel(&self, (x, y): (u32, u32)) -> usize {
        y as usize * self.width + x as usize
    }

    /// Returns the number of a pixel's vectors.
    #[inline]
    pub fn count(&self, pixel: usize) -> u32 {
        self.pixels[pixel].count
    }

    /// Returns one of a pixel's vectors; `index` counts round and round. The pixel must have one.
    #[inline]
    pub fn sample(&self, pixel: usize, index: u32) -> &'a [f32] {
        let Reservoir { values, count } = self.pixels[pixel];
        &values[(index % count) as usize * self.dims..][..self.dims]
    }

    /// Returns all vectors of a pixel.
    #[inline]
    pub fn samples(&self, pixel: usize) -> impl Iterator<Item = &'a [f32]> + use<'a> {
        self.pixels[pixel].values.chunks_exact(self.dims)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::Layout;

    #[test]
    fn samples_are_those_of_the_store() {
        let layout = Layout::with_blocks(|_| true);
        let count = |x: usize, y: usize| (x + y) as u32 % 11;
        let store = store(5, 4, layout.clone(), count, |x, y, index, rng| {
            wall(&layout, x, y, [index as f32, x as f32, y as f32], rng)
        });
        let reservoirs = Reservoirs::new(&store);
        for (x, y) in (0..4).flat_map(|y| (0..5).map(move |x| (x, y))) {
            let expected: Vec<&[f32]> = store.rows()[y].reservoir(x).chunks_exact(layout.len()).collect();
            let pixel = reservoirs.pixel((x as u32, y as u32));
            assert_eq!(reservoirs.count(pixel) as usize, expected.len());
            assert!(reservoirs.samples(pixel).eq(expected.iter().copied()));
            for (index, sample) in expected.iter().cycle().take(20).enumerate() {
                assert_eq!(reservoirs.sample(pixel, index as u32), *sample);
            }
        }
    }
}
