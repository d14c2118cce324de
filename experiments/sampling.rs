//! Uniform sampling without the loop: so many samples in every pixel, and how long they took.

use std::time::Instant;

use prpf::render::Renderer;
use prpf::stats::Store;

/// An empty store for a renderer. `capacity` whole sample vectors are kept per pixel.
pub fn store(renderer: &Renderer, capacity: usize, seed: u64) -> Store {
    let (width, height) = renderer.resolution();
    Store::new(width, height, renderer.layout().clone(), capacity, seed)
}

/// Adds `spp` samples to every pixel. Returns the seconds that this took.
pub fn add(renderer: &Renderer, store: &mut Store, spp: u32) -> f64 {
    timed(|| renderer.render_batch(&vec![spp; store.pixels()], store)).1
}

/// What something gives, and the seconds it takes.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}
