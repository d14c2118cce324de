//! Reads scenes in pbrt's format and renders them.

use std::path::Path;

use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::scene::{Scene, pbrt};
use prpf::stats::{Part, Store};

/// A box seen through a lens, with a visible lamp, a glossy and a rough sphere: several kinds of noise.
pub const NOISY: &str = include_str!("noisy.pbrt");

/// Parses a scene.
pub fn scene(text: &str) -> Scene {
    pbrt::read_str(text, Path::new(".")).expect("the scenes of the hard cases can be read")
}

/// Parses [`NOISY`].
pub fn noisy() -> Scene {
    scene(NOISY)
}

/// Renders uniformly sampled statistics, without a reservoir.
pub fn render(scene: &Scene, samples: u32, seed: u64) -> Store {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, seed);
    let (width, height) = renderer.resolution();
    let mut store = Store::new(width, height, renderer.layout().clone(), 0, seed);
    renderer.render_batch(&vec![samples; width * height], &mut store);
    store
}

/// Mean green radiance of every pixel.
pub fn green(store: &Store, part: Part) -> Vec<f64> {
    let means = store.means(part, store.layout().radiance());
    means.plane(1).iter().map(|&v| v.into()).collect()
}

/// Mean and its standard error.
pub fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
