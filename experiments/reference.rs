//! Renders reference images: uniformly sampled, unfiltered, in two independent halves.
//!
//! Takes a scene and a sample count; gives the mean of the halves, its own expected error, which follows from their difference,
//! and the errors of other images. Halves, and the filtered image that errors are relative to, are cached as EXR files.

use std::path::{Path, PathBuf};

use anyhow::Context;
use prpf::filter::{DEFAULT, learned};
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::image::exr_file::{self, Channel, Precision, Windows};
use prpf::image::metrics::RELMSE_EPSILON;
use prpf::render::Renderer;
use prpf::scene::Scene;
use prpf::stats::{Part, Store};
use sha2::{Digest, Sha256};

use crate::{picture, sampling};

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
    /// Means of independent samples: 3 planes each.
    halves: [Planes; 2],
    /// The filtered image: 3 planes.
    filtered: Planes,
}

impl Reference {
    /// Averages two halves; `spp` is their sum.
    fn new(spp: u32, halves: [Planes; 2], filtered: Planes) -> Self {
        let [a, b] = &halves;
        let mut image = a.clone();
        image.data_mut().iter_mut().zip(b.data()).for_each(|(a, b)| *a = 0.5 * (*a + b));

        // (A − (A + B) ∕ 2)² = ¼ (A − B)²
        let own_error = |i: usize| f64::from(a.data()[i] - image.data()[i]).powi(2);
        let mse = average((0..a.data().len()).map(own_error));
        let relmse = average(relative(&filtered, own_error));
        Self { image, spp, mse, relmse, halves, filtered }
    }

    /// The reference of some pixels of its image: x0, x1, y0, y1, half open.
    pub fn cropped(&self, bounds: [usize; 4]) -> Self {
        let crop = |planes: &Planes| picture::crop(planes, bounds);
        Self::new(self.spp, self.halves.each_ref().map(crop), crop(&self.filtered))
    }

    /// Returns the MSE of an image x: the mean of (x − A)(x − B), without bias as [`Self::pixel_relmse`] is.
    pub fn mse_of(&self, image: &Planes) -> f64 {
        average((0..image.data().len()).map(|i| self.squared_error(image, i)))
    }

    /// Returns the relMSE of an image: the mean of [`Self::pixel_relmse`].
    pub fn relmse_of(&self, image: &Planes) -> f64 {
        average(self.pixel_relmse(image))
    }

    /// (x − A)(x − B) of the value with index `i`.
    fn squared_error(&self, image: &Planes, i: usize) -> f64 {
        let [a, b] = &self.halves;
        let [x, a, b] = [image, a, b].map(|planes| f64::from(planes.data()[i]));
        (x - a) * (x - b)
    }

    /// Returns the relMSE of each pixel of an image x, mean over the channels: (x − A)(x − B) ∕ (F² + 0.01) with the halves A and B
    /// and the filtered reference F. It is without bias, and single values may be negative: A and B have independent noise, which
    /// (x − ½(A + B))² would contain. Relative to the reference's own pixels, those that are too dark would weigh most.
    pub fn pixel_relmse(&self, image: &Planes) -> Vec<f64> {
        relative(&self.filtered, |i| self.squared_error(image, i))
    }
}

/// The mean of some values; NaN of none.
fn average(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.into_iter().fold((0.0, 0_usize), |(sum, count), value| (sum + value, count + 1));
    sum / count as f64
}

/// Returns an error of each value over the squared level, mean over the channels of a pixel.
fn relative(level: &Planes, error: impl Fn(usize) -> f64) -> Vec<f64> {
    let pixels = level.pixels();
    let of_channel = |i: usize| error(i) / (f64::from(level.data()[i]).powi(2) + RELMSE_EPSILON);
    (0..pixels).map(|i| (0..3).map(|c| of_channel(c * pixels + i)).sum::<f64>() / 3.0).collect()
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
    // Derive file names from everything that the images depend on
    let film = &scene.film;
    let cache_key = format!(
        "{} {} {}x{} {:?} {:?} {spp} {SEEDS:?} {}",
        env!("CARGO_PKG_VERSION"),
        scene.hash,
        film.width,
        film.height,
        film.pixel_bounds,
        scene.integrator,
        learned::weights_id()
    );
    let digest = Sha256::digest(cache_key);
    let digest: String = digest[..6].iter().map(|byte| format!("{byte:02x}")).collect();
    let paths = ["a", "b", "filtered"].map(|part| cache.join(format!("{name}-{digest}-{part}.exr")));

    // Read or render the halves, and filter them together
    if !paths.iter().all(|path| path.is_file()) {
        let show_progress = |done: u32| show_status(format!("{name}: reference, {done} of {} spp", spp / 2));
        let [mut a, b] = SEEDS.map(|seed| render(scene, spp / 2, seed, show_progress));
        let radiance = a.layout().radiance();
        let halves = [&a, &b].map(|store| store.means(Part::Whole, radiance.clone()));
        a.merge(&b);
        let filtered = DEFAULT.filter(&a, 0).image;
        let [a, b] = halves;
        paths.iter().zip([a, b, filtered]).try_for_each(|(path, image)| write(path, &image))?;
    }
    let read = |path: &PathBuf| exr_file::read_layer(path, None).with_context(|| path.display().to_string());
    let [a, b, filtered] = paths.each_ref().map(read);
    Ok(Reference::new(spp, [a?, b?], filtered?))
}

fn render(scene: &Scene, spp: u32, seed: u64, show_progress: impl Fn(u32)) -> Store {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, seed);
    let mut store = sampling::store(&renderer, 0, seed);
    for done in (0..spp).step_by(STEP as usize) {
        show_progress(done);
        sampling::add(&renderer, &mut store, STEP.min(spp - done));
    }
    store
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

#[cfg(test)]
mod tests {
    use prpf::image::metrics::Pair;

    use super::*;

    fn planes(value: impl Fn(usize) -> f32) -> Planes {
        let mut planes = Planes::new(20, 18, 3);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = value(i));
        planes
    }

    /// relMSE of an image against an exact one, by a reference with these halves.
    fn relmse(image: &Planes, exact: &Planes, halves: [Planes; 2]) -> f64 {
        Reference::new(2, halves, exact.clone()).relmse_of(image)
    }

    #[test]
    fn against_a_reference_without_noise_the_error_is_the_library_s_relmse() {
        let (image, exact) = (planes(|i| (i % 7) as f32), planes(|i| (i % 5) as f32));
        let expected = Pair::new(&image, &exact).unwrap().relmse();
        let found = relmse(&image, &exact, [exact.clone(), exact.clone()]);
        assert!((found - expected).abs() < 1e-9 * expected, "{found} {expected}");
    }

    #[test]
    fn noise_of_the_halves_is_no_error() {
        // The product of the halves' noise is 0 in the mean, and their squares are not
        let noisy = |period: usize| planes(move |i| if i % period < period / 2 { 1.5 } else { 0.5 });
        let exact = planes(|_| 1.0);
        assert!(relmse(&exact, &exact, [noisy(2), noisy(4)]).abs() < 1e-9);
        let brighter = relmse(&planes(|_| 1.1), &exact, [noisy(2), noisy(4)]);
        assert!((brighter - 0.01 / (1.0 + RELMSE_EPSILON)).abs() < 1e-6, "{brighter}");
        let reference = Reference::new(2, [noisy(2), noisy(4)], exact.clone());
        assert!(reference.mse_of(&exact).abs() < 1e-9, "{}", reference.mse_of(&exact));
        assert!((reference.mse_of(&planes(|_| 1.1)) - 0.01).abs() < 1e-6);
        // Half of the values differ by 1
        assert!((reference.mse - 0.125).abs() < 1e-9, "{}", reference.mse);
    }

    #[test]
    fn a_cropped_reference_is_that_of_its_pixels() {
        let (image, a, b) =
            (planes(|i| (i % 7) as f32), planes(|i| (i % 5) as f32), planes(|i| (i % 4) as f32));
        let bounds = [3, 17, 2, 11];
        let cropped = Reference::new(2, [a.clone(), b.clone()], a.clone()).cropped(bounds);
        let (x, a, b) = (picture::crop(&image, bounds), picture::crop(&a, bounds), picture::crop(&b, bounds));
        let expected: f64 = (0..x.data().len())
            .map(|i| f64::from((x.data()[i] - a.data()[i]) * (x.data()[i] - b.data()[i])))
            .sum::<f64>()
            / x.data().len() as f64;
        assert!((cropped.mse_of(&x) - expected).abs() < 1e-9);
        assert_eq!(cropped.image.data()[0], 0.5 * (a.data()[0] + b.data()[0]));
    }
}
