//! Stores with synthetic samples, for tests.

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

use crate::stats::{Block, Layout, Store};

/// Capacity of a reservoir.
const CAPACITY: usize = 8;

/// Returns a store whose pixel (x, y) has `count(x, y)` samples `sample(x, y, index, rng)`.
pub fn store<S: AsRef<[f32]>>(
    width: usize,
    height: usize,
    layout: Layout,
    count: impl Fn(usize, usize) -> u32 + Sync,
    sample: impl Fn(usize, usize, u32, &mut Pcg32) -> S + Sync,
) -> Store {
    let mut store = Store::new(width, height, layout, CAPACITY, 1);
    store.rows_mut().par_iter_mut().enumerate().for_each(|(y, row)| {
        for x in 0..width {
            let mut rng = Pcg32::seed_from_u64((y * width + x) as u64);
            for index in 0..count(x, y) {
                row.push(x, sample(x, y, index, &mut rng).as_ref());
            }
        }
    });
    store
}

/// Returns a sample of a white wall that fills the view and has the radiance `colour`. All dimensions of the
/// layout are set and none is noisy; random parameters are random.
pub fn wall(layout: &Layout, x: usize, y: usize, colour: [f32; 3], rng: &mut impl Rng) -> Vec<f32> {
    let mut sample = vec![0.0; layout.len()];
    for dim in layout.randoms() {
        sample[dim] = rng.random();
    }
    let film = [x as f32 + rng.random::<f32>(), y as f32 + rng.random::<f32>()];
    layout.write(&mut sample, Block::Film, &film);
    layout.write(&mut sample, Block::Colour, &colour);
    layout.write(&mut sample, Block::Radiance, &colour);
    layout.write(&mut sample, Block::Position1, &[film[0] / 1000.0, film[1] / 1000.0, 0.5]);
    layout.write(&mut sample, Block::Normal1, &[0.0, 0.0, 1.0]);
    layout.write(&mut sample, Block::Albedo, &[0.8; 3]);
    layout.write(&mut sample, Block::Position2, &[0.1, 0.2, 0.9]);
    layout.write(&mut sample, Block::Normal2, &[0.0, 1.0, 0.0]);
    layout.write(&mut sample, Block::Hit, &[1.0]);
    sample
}
