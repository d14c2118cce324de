//! Stores of invented samples.

use prpf::filter::{self, Filtered, Quality};
use prpf::stats::{Block, Layout, Store};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

pub const QUALITIES: [(Quality, &str); 3] =
    [(Quality::Draft, "draft"), (Quality::Standard, "standard"), (Quality::Paper, "paper")];

/// What `--quality paper` keeps of a pixel.
const RESERVOIR: usize = 8;

/// Numbers that belong to one sample of one pixel, wherever the image's corner is.
pub fn numbers(x: usize, y: usize, index: u32) -> Pcg32 {
    Pcg32::seed_from_u64((y as u64) << 40 ^ (x as u64) << 20 ^ u64::from(index))
}

/// [`store_of`] all dimensions.
pub fn store(
    size: (usize, usize),
    count: impl Fn(usize, usize) -> u32 + Sync,
    sample: impl Fn(usize, usize, u32, &mut Pcg32, &mut Sample) + Sync,
) -> Store {
    store_of(Layout::with_blocks(|_| true), size, count, sample)
}

/// A store with `count(x, y)` samples in a pixel, each changed by `sample(x, y, index, numbers,
/// vector)` from that of a white wall under light of radiance 0.5.
pub fn store_of(
    layout: Layout,
    (width, height): (usize, usize),
    count: impl Fn(usize, usize) -> u32 + Sync,
    sample: impl Fn(usize, usize, u32, &mut Pcg32, &mut Sample) + Sync,
) -> Store {
    let mut store = Store::new(width, height, layout.clone(), RESERVOIR, 1);
    store.rows_mut().par_iter_mut().enumerate().for_each(|(y, row)| {
        let mut vector = Sample { layout: layout.clone(), values: vec![0.0; layout.len()] };
        for x in 0..width {
            for index in 0..count(x, y) {
                let mut numbers = numbers(x, y, index);
                vector.white_wall(x, y, &mut numbers);
                sample(x, y, index, &mut numbers, &mut vector);
                row.push(x, &vector.values);
            }
        }
    });
    store
}

/// A sample vector in the making.
pub struct Sample {
    layout: Layout,
    values: Vec<f32>,
}

impl Sample {
    pub fn write(&mut self, block: Block, values: &[f32]) {
        self.layout.write(&mut self.values, block, values);
    }

    /// All of the light, none of it seen directly.
    pub fn lit(&mut self, colour: [f32; 3]) {
        self.write(Block::Colour, &colour);
        self.write(Block::Radiance, &colour);
    }

    /// A ray that leaves the scene and sees this.
    pub fn sky(&mut self, colour: [f32; 3]) {
        self.lit(colour);
        self.write(Block::Colour, &[0.0; 3]);
        self.write(Block::Emission, &colour);
        for block in [Block::Position1, Block::Normal1, Block::Position2, Block::Normal2] {
            self.write(block, &[0.0; 3]);
        }
        self.write(Block::Albedo, &[1.0; 3]);
        self.write(Block::Hit, &[0.0]);
    }

    pub fn random(&self, nth: usize) -> f32 {
        self.values[self.layout.randoms()[nth]]
    }

    /// Positions advance by a thousandth from pixel to pixel.
    pub fn white_wall(&mut self, x: usize, y: usize, numbers: &mut Pcg32) {
        for dim in self.layout.randoms() {
            self.values[dim] = numbers.random();
        }
        let film = [x as f32 + numbers.random::<f32>(), y as f32 + numbers.random::<f32>()];
        self.write(Block::Film, &film);
        self.lit([0.5; 3]);
        self.write(Block::Position1, &[film[0] * 1e-3, film[1] * 1e-3, 0.5]);
        self.write(Block::Normal1, &[0.0, 0.0, 1.0]);
        self.write(Block::Albedo, &[0.8; 3]);
        self.write(Block::Position2, &[0.1, 0.2, 0.9]);
        self.write(Block::Normal2, &[0.0, 1.0, 0.0]);
        self.write(Block::Emission, &[0.0; 3]);
        self.write(Block::Hit, &[1.0]);
    }
}

/// A wall under noisy light of this mean, from zero to twice of it.
pub fn noisy_wall(size: (usize, usize), samples: u32, light: impl Fn(usize, usize) -> f32 + Sync) -> Store {
    store(
        size,
        |_, _| samples,
        |x, y, _, numbers, sample| {
            sample.lit([light(x, y) * 2.0 * numbers.random::<f32>(); 3]);
        },
    )
}

pub fn filtered(store: &Store, quality: Quality) -> Filtered {
    filter::filter(store, quality, 1)
}

/// Numbers of a filter's result that are not finite.
pub fn not_finite(filtered: &Filtered) -> usize {
    let Filtered { image, halves: [a, b], residual, variance, error, .. } = filtered;
    let planes = [image, a, b, residual, variance, error];
    planes.iter().flat_map(|planes| planes.data()).filter(|v| !v.is_finite()).count()
}
