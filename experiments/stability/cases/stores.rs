//! Makes stores of synthetic samples and filters them.

use prpf::filter::prpf::PRPF;
use prpf::filter::{Denoiser, FilterResult, learned, nlm};
use prpf::stats::{Block, Layout, Store};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// The filters, by name.
pub const FILTERS: [(&'static dyn Denoiser, &str); 5] = [
    (&nlm::DRAFT, "nlm, draft"),
    (&nlm::STANDARD, "nlm"),
    (&learned::DRAFT, "learned, draft"),
    (&learned::STANDARD, "learned"),
    (&PRPF, "prpf"),
];

/// Reservoir capacity that P-RPF needs.
const RESERVOIR: usize = 8;

/// The random numbers of one sample of a pixel.
pub fn rng(x: usize, y: usize, index: u32) -> Pcg32 {
    Pcg32::seed_from_u64((y as u64) << 40 ^ (x as u64) << 20 ^ u64::from(index))
}

/// Makes a store with all dimensions; see [`store_with_layout`].
pub fn store(
    size: (usize, usize),
    count: impl Fn(usize, usize) -> u32 + Sync,
    sample: impl Fn(usize, usize, u32, &mut Pcg32, &mut Sample) + Sync,
) -> Store {
    store_with_layout(Layout::with_blocks(|_| true), size, count, sample)
}

/// Makes a store with `count(x, y)` samples in a pixel. Each starts as a sample of a white wall under light of
/// radiance 0.5, and `sample(x, y, index, rng, vector)` changes it.
pub fn store_with_layout(
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
                let mut rng = rng(x, y, index);
                vector.white_wall(x, y, &mut rng);
                sample(x, y, index, &mut rng, &mut vector);
                row.push(x, &vector.values);
            }
        }
    });
    store
}

/// A sample vector and its layout.
pub struct Sample {
    layout: Layout,
    values: Vec<f32>,
}

impl Sample {
    /// Sets the dimensions of a block.
    pub fn write(&mut self, block: Block, values: &[f32]) {
        self.layout.write(&mut self.values, block, values);
    }

    /// Sets the reflected radiance.
    pub fn lit(&mut self, colour: [f32; 3]) {
        self.write(Block::Colour, &colour);
        self.write(Block::Radiance, &colour);
    }

    /// Makes it the sample of a ray that leaves the scene.
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

    /// The n-th random parameter.
    pub fn random(&self, nth: usize) -> f32 {
        self.values[self.layout.randoms()[nth]]
    }

    /// Makes it a sample of a white wall, whose positions advance by 0.001 from pixel to pixel.
    pub fn white_wall(&mut self, x: usize, y: usize, rng: &mut Pcg32) {
        for dim in self.layout.randoms() {
            self.values[dim] = rng.random();
        }
        let film = [x as f32 + rng.random::<f32>(), y as f32 + rng.random::<f32>()];
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

/// Makes the store of a wall under noisy light, uniform from zero to twice the mean `light`.
pub fn noisy_wall(size: (usize, usize), samples: u32, light: impl Fn(usize, usize) -> f32 + Sync) -> Store {
    store(
        size,
        |_, _| samples,
        |x, y, _, rng, sample| {
            sample.lit([light(x, y) * 2.0 * rng.random::<f32>(); 3]);
        },
    )
}

/// Filters a store.
pub fn filtered(store: &Store, denoiser: &dyn Denoiser) -> FilterResult {
    denoiser.filter(store, 1)
}

/// Number of values of a filter's result that are not finite.
pub fn not_finite(filtered: &FilterResult) -> usize {
    let FilterResult { image, halves: [a, b], residual, variance, error, .. } = filtered;
    let planes = [image, a, b, residual, variance, error];
    planes.iter().flat_map(|planes| planes.data()).filter(|v| !v.is_finite()).count()
}
