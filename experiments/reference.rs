//! Renders reference images: uniformly sampled, unfiltered, in two independent halves.
//!
//! Takes a scene and a sample count; gives the mean of the halves and its own expected error, which follows from
//! their difference. Halves are cached as EXR files.

use std::path::Path;

use anyhow::Context;
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::image::exr_file::{self, Channel, Precision, Windows};
use prpf::image::metrics::Pair;
use prpf::render::Renderer;
use prpf::scene::Scene;
use prpf::stats::Part;
use sha2::{Digest, Sha256};

use crate::sampling;

/// Seeds of the halves. Those of experiments count from 0.
const SEEDS: [u64; 2] = [1_000_001, 1_000_002];
/// Samples per pixel between two updates of the progress display.
const STEP: u32 = 64;

/// A reference image and its own error.
pub struct Reference {
    /// 3 planes.
    pub image: Planes,
    /// Samples per pixel.
    pub spp: u32,
    /// Expected MSE of the image against the true one: ¼ ⟨(A − B)²⟩ for halves A and B.
    pub mse: f64,
    /// Expected relMSE, likewise.
    pub relmse: f64,
}

/// Reads the reference of a scene with `spp` samples per pixel from the folder `cache`, or renders it and passes
/// its progress to `show_status`. The cache does not depend on the renderer's code: delete it after a change of
/// what the renderer converges to.
///
/// # Errors
/// A cache that cannot be read or written.
pub fn reference(
    scene: &Scene,
    name: &str,
    spp: u32,
    cache: &Path,
    show_status: impl Fn(String),
) -> anyhow::Result<Reference> {
    // Derive file names from everything that the halves depend on
    let film = &scene.film;
    let cache_key = format!(
        "{} {} {}x{} {:?} {:?} {spp} {SEEDS:?}",
        env!("CARGO_PKG_VERSION"),
        scene.hash,
        film.width,
        film.height,
        film.pixel_bounds,
        scene.integrator
    );
    let digest = Sha256::digest(cache_key);
    let digest: String = digest[..6].iter().map(|byte| format!("{byte:02x}")).collect();
    let paths = [0, 1].map(|half| cache.join(format!("{name}-{digest}-{half}.exr")));

    // Read or render the halves
    let mut halves = Vec::new();
    for (path, seed) in paths.iter().zip(SEEDS) {
        if !path.is_file() {
            let show_progress =
                |done: u32| show_status(format!("{name}: reference, {done} of {} spp", spp / 2));
            write(path, &render(scene, spp / 2, seed, show_progress))?;
        }
        halves.push(exr_file::read_layer(path, None).with_context(|| path.display().to_string())?);
    }

    // Average the halves
    let mut image = halves[0].clone();
    image.data_mut().iter_mut().zip(halves[1].data()).for_each(|(a, b)| *a = 0.5 * (*a + b));
    let (mse, relmse) = {
        // (A − (A+B)∕2)² = ¼ (A − B)².
        let pair = Pair::new(&halves[0], &image)?;
        (pair.mse(), pair.relmse())
    };
    Ok(Reference { image, spp, mse, relmse })
}

fn render(scene: &Scene, spp: u32, seed: u64, show_progress: impl Fn(u32)) -> Planes {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, seed);
    let mut store = sampling::store(&renderer, 0, seed);
    for done in (0..spp).step_by(STEP as usize) {
        show_progress(done);
        sampling::add(&renderer, &mut store, STEP.min(spp - done));
    }
    store.means(Part::Whole, store.layout().radiance())
}

fn write(path: &Path, image: &Planes) -> anyhow::Result<()> {
    let channels: Vec<Channel> = ["R", "G", "B"]
        .iter()
        .enumerate()
        .map(|(c, name)| Channel::new(*name, image.plane(c), Precision::Float))
        .collect();
    let windows = Windows::whole(image.width(), image.height());
    exr_file::write(path, windows, &channels, &[]).with_context(|| path.display().to_string())
}
