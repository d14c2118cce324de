//! Images to measure errors by: uniformly sampled, unfiltered, with seeds of their own, in two
//! independent halves, whose difference tells the reference's own error.

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

/// Seeds of the halves. Experiments count theirs from 0.
const SEEDS: [u64; 2] = [1_000_001, 1_000_002];
/// Samples per pixel from one sign of life to the next.
const STEP: u32 = 64;

/// A reference, and how far off it is itself.
pub struct Reference {
    /// 3 planes.
    pub image: Planes,
    /// Samples per pixel.
    pub spp: u32,
    /// Expected MSE of the image against the truth: ¼ ⟨(A − B)²⟩ of its halves.
    pub mse: f64,
    /// Expected relMSE likewise.
    pub relmse: f64,
}

/// The reference of `spp` samples per pixel (half of them in each half) for a scene as it is loaded: from
/// the cache, or rendered, `doing` being told how far it is. It is found again by everything it follows
/// from but the renderer itself; empty the cache when that converges to something else.
///
/// # Errors
/// A cache that cannot be read or written.
pub fn reference(
    scene: &Scene,
    name: &str,
    spp: u32,
    cache: &Path,
    doing: impl Fn(String),
) -> anyhow::Result<Reference> {
    let film = &scene.film;
    let follows_from = format!(
        "{} {} {}x{} {:?} {:?} {spp} {SEEDS:?}",
        env!("CARGO_PKG_VERSION"),
        scene.hash,
        film.width,
        film.height,
        film.pixel_bounds,
        scene.integrator
    );
    let digest = Sha256::digest(follows_from);
    let digest: String = digest[..6].iter().map(|byte| format!("{byte:02x}")).collect();
    let paths = [0, 1].map(|half| cache.join(format!("{name}-{digest}-{half}.exr")));
    let mut halves = Vec::new();
    for (path, seed) in paths.iter().zip(SEEDS) {
        if !path.is_file() {
            let told = |done: u32| doing(format!("{name}: reference, {done} of {} spp", spp / 2));
            write(path, &render(scene, spp / 2, seed, told))?;
        }
        halves.push(exr_file::read_layer(path, None).with_context(|| path.display().to_string())?);
    }
    let mut image = halves[0].clone();
    image.data_mut().iter_mut().zip(halves[1].data()).for_each(|(a, b)| *a = 0.5 * (*a + b));
    let (mse, relmse) = {
        // (A − (A+B)∕2)² = ¼ (A − B)².
        let pair = Pair::new(&halves[0], &image)?;
        (pair.mse(), pair.relmse())
    };
    Ok(Reference { image, spp, mse, relmse })
}

fn render(scene: &Scene, spp: u32, seed: u64, told: impl Fn(u32)) -> Planes {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, seed);
    let mut store = sampling::store(&renderer, 0, seed);
    for done in (0..spp).step_by(STEP as usize) {
        told(done);
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
