//! Cost of keeping the statistics: one sample vector of all 27 dimensions into the store.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use prpf::stats::{Layout, Store};

const WIDTH: usize = 512;
const SAMPLES: usize = 8;

fn statistics(c: &mut Criterion) {
    let layout = Layout::with_blocks(|_| true);
    let samples: Vec<f32> = (0..SAMPLES * layout.len()).map(|i| (i * 7919 % 1000) as f32 * 1e-3).collect();
    let mut group = c.benchmark_group("statistics");
    group.throughput(Throughput::Elements((WIDTH * SAMPLES) as u64));
    for capacity in [0, 8] {
        let mut store = Store::new(WIDTH, 1, layout.clone(), capacity, 0);
        group.bench_function(format!("push, reservoir of {capacity}"), |b| {
            b.iter(|| (0..WIDTH).for_each(|x| store.push(x, 0, black_box(&samples))));
        });
    }
    group.finish();
}

criterion_group!(benches, statistics);
criterion_main!(benches);
