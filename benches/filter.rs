//! Times of the filters on a made-up image with all 27 dimensions: textured walls at four depths,
//! noisy colours, features of the second hit that follow the BSDF numbers.

use criterion::{Criterion, criterion_group, criterion_main};
use prpf::filter::prpf::{FAILURE_WINDOW, PRPF, filter, interpolation};
use prpf::filter::{Denoiser, PrpfSettings, learned, nlm};
use prpf::stats::{Block, Layout, Store};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

const CAPACITY: usize = 8;

fn store(size: usize, spp: u32) -> Store {
    let layout = Layout::with_blocks(|_| true);
    let mut store = Store::new(size, size, layout.clone(), CAPACITY, 1);
    let mut sample = vec![0.0; layout.len()];
    for y in 0..size {
        for x in 0..size {
            let mut rng = Pcg32::seed_from_u64((y * size + x) as u64);
            for _ in 0..spp {
                make(&layout, size, x, y, &mut rng, &mut sample);
                store.push(x, y, &sample);
            }
        }
    }
    store
}

fn make(layout: &Layout, size: usize, x: usize, y: usize, rng: &mut Pcg32, sample: &mut [f32]) {
    for dim in layout.randoms() {
        sample[dim] = rng.random();
    }
    let [u, v] = layout.block(Block::Bsdf1).map_or([0.5; 2], |d| [sample[d.start], sample[d.start + 1]]);
    let [lens, light] =
        [Block::Lens, Block::Light1].map(|b| layout.block(b).map_or(0.5, |d| sample[d.start]));
    let film = [x as f32 + rng.random::<f32>(), y as f32 + rng.random::<f32>()];
    let wall = (x * 4 / size) as f32;
    // The right half is out of focus.
    let blur = if x > size / 2 { (lens - 0.5) * 8.0 } else { 0.0 };
    let [px, py] = [(film[0] + blur) / size as f32, (film[1] + blur) / size as f32];
    let checker = ((px * 40.0).floor() + (py * 40.0).floor()) % 2.0;
    let albedo = [0.3 + 0.5 * checker, 0.5, 0.7 - 0.3 * checker];
    let light = 4.0 * (1.0 - px) * if light > 0.7 { 1.0 } else { 0.1 } * (0.5 + u);
    layout.write(sample, Block::Film, &film);
    layout.write(sample, Block::Colour, &albedo.map(|a| a * light));
    layout.write(sample, Block::Radiance, &albedo.map(|a| a * light));
    layout.write(sample, Block::Position1, &[px, py, 0.3 + 0.1 * wall + 0.05 * px]);
    layout.write(sample, Block::Normal1, &[0.1 * wall, 0.0, (1.0 - 0.01 * wall * wall).sqrt()]);
    layout.write(sample, Block::Albedo, &albedo);
    layout.write(sample, Block::Position2, &[u, v, if u + v > 1.0 { 0.9 } else { 0.1 }]);
    layout.write(sample, Block::Normal2, &[f32::from(u > 0.5), f32::from(u <= 0.5), 0.0]);
    layout.write(sample, Block::Hit, &[1.0]);
}

/// Each pixel-based denoiser at 8 and 64 samples per pixel: the time hardly depends on the samples.
fn denoisers(c: &mut Criterion) {
    let mut group = c.benchmark_group("512×512");
    group.sample_size(10);
    let denoisers: [&dyn Denoiser; 5] =
        [&PRPF, &nlm::STANDARD, &nlm::DRAFT, &learned::STANDARD, &learned::DRAFT];
    for spp in [8, 64] {
        let store = store(512, spp);
        for denoiser in denoisers {
            group.bench_function(format!("{}, {spp} samples", denoiser.name()), |b| {
                b.iter(|| denoiser.filter(&store, 1));
            });
        }
    }
    group.finish();
}

fn parts_of_prpf(c: &mut Criterion) {
    let settings = PrpfSettings::paper();
    let mut group = c.benchmark_group("parts of prpf");
    group.sample_size(10);
    let store = store(512, 8);
    group.bench_function("512×512, no mutual information", |b| {
        let settings = PrpfSettings { mi_samples: 0, ..settings.clone() };
        b.iter(|| filter(&store, &settings, 1));
    });
    group.bench_function("512×512, grid stage alone", |b| {
        b.iter(|| interpolation(&store, &settings, FAILURE_WINDOW))
    });
    group.finish();
}

/// What mutual information costs: one evaluation at each pixel and pass.
fn mutual_information(c: &mut Criterion) {
    let store = store(64, 8);
    let mut group = c.benchmark_group("weights at every pixel");
    group.sample_size(10);
    for mi_samples in [512, 2048] {
        group.bench_function(format!("64×64, {mi_samples} samples"), |b| {
            let settings = PrpfSettings { mi_samples, upsampling: false, ..PrpfSettings::paper() };
            b.iter(|| filter(&store, &settings, 1));
        });
    }
    group.finish();
}

criterion_group!(benches, denoisers, parts_of_prpf, mutual_information);
criterion_main!(benches);
