//! Samples per second of each of the project's own scenes, and of three simple ones that other renderers
//! are compared on (`experiments/mitsuba`); statistics included.

use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::scene::pbrt;
use prpf::stats::Store;

/// The film's longer side: large enough to be typical, small enough to be quick.
const SIDE: usize = 128;

fn scenes(c: &mut Criterion) {
    let mut group = c.benchmark_group("scenes");
    group.sample_size(10);
    let own = ["pool", "statues", "figure", "courtyard", "ajar"].map(|name| format!("scenes/{name}/{name}"));
    let simple = ["cornell", "lens", "glossy"].map(|name| format!("benches/throughput/{name}"));
    for name in own.iter().chain(&simple) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name).with_extension("pbrt");
        let mut scene = pbrt::read(&path).expect("the project's own scenes can be read");
        let longer = scene.film.width.max(scene.film.height);
        let (width, height) = (scene.film.width * SIDE / longer, scene.film.height * SIDE / longer);
        scene.resize_film(width, height);
        let accel = Accel::build(&scene);
        let renderer = Renderer::new(&scene, &accel, 0);
        let mut store = Store::new(width, height, renderer.layout().clone(), 4, 0);
        let counts = vec![1; store.pixels()];
        group.throughput(Throughput::Elements(counts.len() as u64));
        group.bench_function(name, |b| b.iter(|| renderer.render_batch(&counts, &mut store)));
    }
    group.finish();
}

criterion_group!(benches, scenes);
criterion_main!(benches);
