//! All measurements of one scene.

use std::path::PathBuf;

use prpf::filter::{prpf as pixelwise, tolerance};
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::image::metrics::Pair;
use prpf::render::Renderer;
use prpf::scene::Scene;
use prpf::stats::Store;

use super::data::{
    EQUAL, Measured, OUTSIDE, PRPF, READING, REFERENCE, RPF, STANDARD, UNFILTERED, UPSAMPLING, WHOLE,
};
use super::methods::{Method, published, published_rpf, readings};
use super::part::Part;
use super::settings::{SceneSettings, Settings};
use super::weight_pictures;
use crate::bench::Bench;
use crate::ledger::{Key, Values, values};
use crate::picture;
use crate::reference::{Reference, reference};
use crate::sampling;
use crate::scenes::{SceneFile, View};

/// Folder of the pictures in the results.
pub const PICTURES: &str = "pictures";

/// A scene's part, ready to be rendered.
struct Subject<'a> {
    settings: &'a Settings,
    of_scene: &'a SceneSettings,
    renderer: &'a Renderer<'a>,
    part: Part,
    /// Pixels of the whole image.
    film_pixels: usize,
    reference: &'a Reference,
    pictures: PathBuf,
}

/// Takes all measurements of a scene.
///
/// # Errors
/// What is wrong with the scene, or files that cannot be written.
pub fn measure(
    bench: &mut Bench,
    settings: &Settings,
    of_scene: &SceneSettings,
    file: &SceneFile,
) -> anyhow::Result<Measured> {
    let name = &of_scene.name;
    bench.doing(format!("{name}: reading"));
    let mut scene = file.load(View::default())?;
    let mut measured = Measured {
        name: name.clone(),
        of_paper: of_scene.of_paper,
        rpf_spp: Vec::new(),
        runs: Default::default(),
    };
    if settings.whole_spp > 0 {
        let values = whole(bench, settings, of_scene, &scene)?;
        measured.runs.insert(WHOLE.to_owned(), values);
    }
    let film = (scene.film.width, scene.film.height);
    let part = Part::new(of_scene.crop, settings.crop_share, settings.margin, film);

    scene.film.pixel_bounds = part.inner;
    let told = |what| bench.doing(what);
    let reference = reference(&scene, name, settings.reference_spp, &bench.cache, told)?;
    let pictures = bench.out.join(PICTURES);
    std::fs::create_dir_all(&pictures)?;
    picture::write(&pictures.join(format!("{name}-reference.png")), &reference.image, of_scene.exposure)?;

    scene.film.pixel_bounds = part.outer;
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let film_pixels = film.0 * film.1;
    let subject = Subject {
        settings,
        of_scene,
        renderer: &renderer,
        part,
        film_pixels,
        reference: &reference,
        pictures,
    };
    subject.measure(bench, &mut measured)?;
    Ok(measured)
}

/// P-RPF and the default on the whole image.
fn whole(
    bench: &mut Bench,
    settings: &Settings,
    of_scene: &SceneSettings,
    scene: &Scene,
) -> anyhow::Result<Values> {
    let spp = settings.whole_spp;
    let key = Key::new(&of_scene.name, settings.seed, format!("whole image, spp={spp}"));
    bench.doing(format!("{}: whole image", of_scene.name));
    bench.ledger.measure(key, &[], || {
        let accel = Accel::build(scene);
        let renderer = Renderer::new(scene, &accel, settings.seed);
        let method = Method::Prpf(published(of_scene.sigma8_squared));
        let mut store = sampling::store(&renderer, method.capacity(spp), settings.seed);
        let render = sampling::add(&renderer, &mut store, spp);
        let (_, mut values) = method.run(&store, settings.seed, 1);
        let (_, standard) = Method::Standard.run(&store, settings.seed, 1);
        values.insert("render seconds".to_owned(), render);
        values.insert("standard seconds".to_owned(), standard["seconds"]);
        values.insert("pixels".to_owned(), store.pixels() as f64);
        Ok(values)
    })
}

impl Subject<'_> {
    fn key(&self, what: &str) -> Key {
        let Settings { seed, margin, reference_spp, .. } = *self.settings;
        let settings = format!(
            "{what} sigma8={} crop={:?} margin={margin} reference={reference_spp}",
            self.of_scene.sigma8_squared, self.part.inner
        );
        Key::new(&self.of_scene.name, seed, settings)
    }

    fn measure(&self, bench: &mut Bench, measured: &mut Measured) -> anyhow::Result<()> {
        let Settings { base_spp, .. } = *self.settings;
        let Reference { mse, relmse, spp, .. } = *self.reference;
        let stated = [
            ("mse", mse),
            ("relmse", relmse),
            ("spp", f64::from(spp)),
            ("pixels of the part", self.part.pixels() as f64),
            ("pixels of the image", self.film_pixels as f64),
        ];
        let own = bench.ledger.measure(self.key(REFERENCE), &[], || Ok(values(stated)))?;
        measured.runs.insert(REFERENCE.to_owned(), own);

        let most = self.of_scene.most_rpf_spp.min(self.settings.most_rpf_spp);
        measured.rpf_spp = self.settings.spp.iter().copied().filter(|&spp| spp <= most).collect();
        let sigma8_squared = self.of_scene.sigma8_squared;
        for &spp in &self.settings.spp {
            let mut methods = vec![
                (UNFILTERED, Method::Unfiltered),
                (PRPF, Method::Prpf(published(sigma8_squared))),
                (STANDARD, Method::Standard),
            ];
            if spp <= most {
                methods.push((RPF, Method::Rpf(published_rpf(sigma8_squared))));
            }
            for (name, method) in &methods {
                let run = format!("{name} {spp}");
                let shown = (*name == RPF && spp == base_spp).then_some(RPF);
                let values = self.run(bench, &run, method, spp, shown)?;
                measured.runs.insert(run, values);
            }
        }
        self.equal_time(bench, measured)?;
        for (name, method) in readings(sigma8_squared) {
            let run = format!("{READING} {name}");
            let values = self.run(bench, &run, &method, base_spp, None)?;
            measured.runs.insert(run, values);
        }
        self.upsampling(bench, measured)?;
        self.outside(bench, measured)
    }

    /// A method at a sample count; the image is kept as a picture of this name.
    fn run(
        &self,
        bench: &mut Bench,
        run: &str,
        method: &Method,
        spp: u32,
        shown: Option<&str>,
    ) -> anyhow::Result<Values> {
        bench.doing(format!("{}: {run}, {spp} spp", self.of_scene.name));
        let picture = shown.map(|name| self.pictures.join(format!("{}-{name}.png", self.of_scene.name)));
        let files: Vec<PathBuf> = picture.iter().cloned().collect();
        let key = self.key(&format!("run={} spp={spp}", run.replace(' ', "-")));
        bench.ledger.measure(key, &files, || {
            let (store, render) = self.samples(spp, method.capacity(spp));
            let (image, mut values) = method.run(&store, self.settings.seed, self.settings.repeats);
            let image = picture::part(&image, self.part.within());
            let pair = Pair::new(&image, &self.reference.image)?;
            values.insert("render seconds".to_owned(), render);
            values.insert("mse".to_owned(), pair.mse());
            values.insert("relmse".to_owned(), pair.relmse());
            values.insert("flip".to_owned(), pair.flip().mean);
            values.insert("spp".to_owned(), f64::from(spp));
            for file in &files {
                picture::write(file, &image, self.of_scene.exposure)?;
            }
            Ok(values)
        })
    }

    fn samples(&self, spp: u32, capacity: usize) -> (Store, f64) {
        let mut store = sampling::store(self.renderer, capacity, self.settings.seed);
        let seconds = sampling::add(self.renderer, &mut store, spp);
        (store, seconds)
    }

    /// Every other method in the time, sampling included, that RPF takes at the base count.
    fn equal_time(&self, bench: &mut Bench, measured: &mut Measured) -> anyhow::Result<()> {
        let base = self.settings.base_spp;
        let total = |method: &str, spp: u32| {
            measured.at(method, spp, "render seconds") + measured.at(method, spp, "seconds")
        };
        let time = total(RPF, base);
        if !time.is_finite() {
            return Ok(());
        }
        // What a sample takes is known best from the largest count.
        let largest = self.settings.spp.iter().copied().max().unwrap_or(base);
        let mut equal = Vec::new();
        for (name, method) in [
            (PRPF, Method::Prpf(published(self.of_scene.sigma8_squared))),
            (STANDARD, Method::Standard),
            (UNFILTERED, Method::Unfiltered),
        ] {
            let per_sample = measured.at(name, largest, "render seconds") / f64::from(largest);
            let filter = measured.at(name, largest, "seconds");
            equal.push((
                name,
                method,
                affordable(time - filter, per_sample, self.settings.most_equal_time_spp),
            ));
        }
        for (name, method, spp) in equal {
            let run = format!("{EQUAL} {name}");
            let values = self.run(bench, &run, &method, spp, Some(name))?;
            measured.runs.insert(run, values);
        }
        Ok(())
    }

    /// Weights interpolated and computed at every pixel: time of this stage and of all, and errors.
    fn upsampling(&self, bench: &mut Bench, measured: &mut Measured) -> anyhow::Result<()> {
        let (spp, seed) = (self.settings.base_spp, self.settings.seed);
        let name = &self.of_scene.name;
        bench.doing(format!("{name}: upsampling"));
        let shown = self.of_scene.weight_pictures.then(|| weight_pictures::files(&self.pictures, name));
        let files: Vec<PathBuf> = shown.clone().into_iter().flatten().collect();
        let key = self.key(&format!("{UPSAMPLING} spp={spp}"));
        let values = bench.ledger.measure(key, &files, || {
            let (store, _) = self.samples(spp, spp as usize);
            let with = published(self.of_scene.sigma8_squared);
            let without = pixelwise::PrpfSettings { upsampling: false, ..with.clone() };
            let mut result = Values::new();
            for (name, settings) in [("with", &with), ("without", &without)] {
                let (image, values) = Method::Prpf(settings.clone()).run(&store, seed, 1);
                let image = picture::part(&image, self.part.within());
                result.insert(format!("mse {name}"), Pair::new(&image, &self.reference.image)?.mse());
                result.insert(format!("seconds {name}"), values["seconds"]);
                result.insert(format!("weight seconds {name}"), values["weight seconds"]);
                result.extend(values.get("interpolated").map(|&share| ("interpolated".to_owned(), share)));
            }
            let (names, interpolated) = pixelwise::feature_weights(&store, &with, seed);
            let (_, direct) = pixelwise::feature_weights(&store, &without, seed);
            let threshold = with.interpolation_threshold;
            result.insert("weights mse".to_owned(), weights_mse(&interpolated, &direct, threshold));
            if let Some(files) = &shown {
                let rpf = published_rpf(self.of_scene.sigma8_squared);
                weight_pictures::write(files, &names, [&interpolated[0], &direct[0]], &store, &rpf, seed)?;
            }
            Ok(result)
        })?;
        measured.runs.insert(UPSAMPLING.to_owned(), values);
        Ok(())
    }

    /// Samples that a choice by pixels lets in, window by window.
    fn outside(&self, bench: &mut Bench, measured: &mut Measured) -> anyhow::Result<()> {
        let spp = self.settings.base_spp;
        let key = self.key(&format!("{OUTSIDE} spp={spp}"));
        let values = bench.ledger.measure(key, &[], || {
            let (store, _) = self.samples(spp, spp as usize);
            let settings = published(self.of_scene.sigma8_squared);
            let shares = settings.windows.iter().map(|&window| {
                (format!("window {window}"), tolerance::samples_outside(&store, &settings, window))
            });
            Ok(shares.collect())
        })?;
        measured.runs.insert(OUTSIDE.to_owned(), values);
        Ok(())
    }
}

/// Samples per pixel that fit into some seconds: an even number, for the halves, and at least one of each.
fn affordable(seconds: f64, per_sample: f64, most: u32) -> u32 {
    let spp = (seconds / per_sample).clamp(2.0, f64::from(most)) as u32;
    spp - spp % 2
}

/// Mean squared difference of interpolated weights from those computed directly, over passes, weights and
/// the pixels where they were interpolated. The last plane is the sum of interpolation weights.
fn weights_mse(interpolated: &[Planes], direct: &[Planes], threshold: f32) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for (interpolated, direct) in interpolated.iter().zip(direct) {
        // Behind the β and α stand W_c^r, which is no weight, and the sums.
        let weights = interpolated.count() - 2;
        let sums = interpolated.plane(interpolated.count() - 1);
        for k in 0..weights {
            let pairs = interpolated.plane(k).iter().zip(direct.plane(k)).zip(sums);
            for ((a, b), _) in pairs.filter(|(_, sum)| sum.is_finite() && **sum > threshold) {
                sum += f64::from(a - b).powi(2);
                count += 1;
            }
        }
    }
    sum / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes(weight: f32, sums: [f32; 3]) -> Planes {
        // One weight, W_c^r, and the sums.
        let mut planes = Planes::new(3, 1, 3);
        planes.plane_mut(0).fill(weight);
        planes.plane_mut(1).fill(7.0 * weight);
        planes.plane_mut(2).copy_from_slice(&sums);
        planes
    }

    #[test]
    fn the_error_of_weights_is_that_of_interpolated_ones() {
        let mut with = planes(0.5, [1.0, 0.05, f32::INFINITY]);
        with.plane_mut(0)[1] = 9.0;
        with.plane_mut(0)[2] = 9.0;
        let without = planes(0.25, [f32::INFINITY; 3]);
        assert_eq!(weights_mse(&[with], &[without], 0.1), 0.0625);
    }

    #[test]
    fn the_time_that_is_left_is_spent_on_an_even_number_of_samples() {
        assert_eq!(affordable(8.0, 0.25, 100), 32);
        assert_eq!(affordable(8.0, 0.24, 100), 32);
        assert_eq!(affordable(8.0, 1e-3, 100), 100);
        assert_eq!(affordable(-1.0, 1.0, 100), 2);
    }
}
