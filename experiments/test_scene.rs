//! Loads a scene at the resolution of an experiment, with its reference image.

use std::collections::BTreeMap;

use anyhow::ensure;
use prpf::image::Planes;
use prpf::image::metrics::Pair;
use prpf::scene::Scene;
use serde::Deserialize;

use crate::reference::{self, Reference};
use crate::scenes::{SceneFile, View};
use crate::session::Session;

/// Fraction of the pixels that the trimmed relMSE leaves out: those with the largest errors.
const WORST: f64 = 0.001;

/// Film size and reference quality: the table `size` of an experiment's settings.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Size {
    /// Approximate number of pixels of a film.
    pixels: f64,
    /// Samples per pixel of a reference.
    reference_spp: u32,
    /// Samples per pixel of the references of noisier scenes, by scene.
    harder: BTreeMap<String, u32>,
}

/// A scene with its reference image.
pub struct TestScene {
    pub name: String,
    /// Whether it is one of the public scenes, on which no constant is chosen.
    pub is_public: bool,
    pub scene: Scene,
    pub reference: Reference,
}

impl TestScene {
    /// Loads the scene and scales its film down to `size.pixels`.
    ///
    /// # Errors
    /// A scene file or a cached reference that cannot be read; a size that is too small.
    pub fn new(session: &Session, file: &SceneFile, size: &Size) -> anyhow::Result<Self> {
        ensure!(size.pixels >= 1.0, "size.pixels: found {}; accepted is 1 or more", size.pixels);
        session.show_status(format!("{}: reading", file.name));
        let mut scene = file.load(View::default())?;
        let (width, height) = (scene.film.width as f64, scene.film.height as f64);
        let scale = (size.pixels / (width * height)).sqrt().min(1.0);
        let [width, height] = [width, height].map(|side| (side * scale).round().max(1.0) as usize);
        scene.resize_film(width, height);
        let spp = size.harder.get(&file.name).copied().unwrap_or(size.reference_spp);
        ensure!(
            spp >= 2,
            "size.reference_spp or size.harder: found {spp}; accepted is 2 or more, one for each half"
        );
        let show = |status| session.show_status(status);
        let reference = reference::reference(&scene, &file.name, spp, &session.cache, show)?;
        Ok(Self { name: file.name.clone(), is_public: file.is_public, scene, reference })
    }

    /// Errors of an image against the reference, by name: relMSE, with and without the worst pixels, and ꟻLIP. [`f64::MIN_POSITIVE`] stands for a
    /// relMSE that is lost in the reference's noise: the mean of its values is not positive.
    pub fn errors(&self, image: &Planes) -> [(&'static str, f64); 3] {
        let mut pixels = self.reference.pixel_relmse(image);
        pixels.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let mean = |pixels: &[f64]| (pixels.iter().sum::<f64>() / pixels.len() as f64).max(f64::MIN_POSITIVE);
        let kept = pixels.len() - (pixels.len() as f64 * WORST).ceil() as usize;
        let pair = Pair::new(image, &self.reference.image).expect("a render of the reference's size");
        [("relmse", mean(&pixels)), ("trimmed relmse", mean(&pixels[..kept])), ("flip", pair.flip().mean)]
    }
}

/// Splits results into those on our scenes and those on public ones, each if there are some.
pub fn groups<T>(all: &[T], is_public: fn(&T) -> bool) -> Vec<(&'static str, Vec<&T>)> {
    let group = |public: bool| all.iter().filter(|results| is_public(results) == public).collect::<Vec<_>>();
    let groups = [("our scenes", group(false)), ("public scenes", group(true))];
    groups.into_iter().filter(|(_, scenes)| !scenes.is_empty()).collect()
}
