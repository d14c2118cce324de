//! Renders the same number of samples in every pixel, without the render loop, and measures the time.

use std::time::Instant;

use prpf::render::Renderer;
use prpf::stats::Store;

/// Makes an empty store for a renderer, with a reservoir of `capacity` sample vectors per pixel.
pub fn store(renderer: &Renderer, capacity: usize, seed: u64) -> Store {
    let (width, height) = renderer.resolution();
    Store::new(width, height, renderer.layout().clone(), capacity, seed)
}

/// Adds `spp` samples to every pixel. Returns the elapsed seconds.
pub fn add(renderer: &Renderer, store: &mut Store, spp: u32) -> f64 {
    timed(|| renderer.render_batch(&vec![spp; store.pixels()], store)).1
}

/// Returns the result of `work`, and the elapsed seconds.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}
