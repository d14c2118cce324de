//! Measures methods on a crop of a scene.

use std::path::{Path, PathBuf};

use prpf::filter::prpf as pixelwise;
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::image::metrics::Pair;
use prpf::render::Renderer;
use prpf::scene::Scene;
use prpf::stats::Store;

use super::crop::{Bounds, Crop, area, middle, relative};
use super::interpretations::{compared_rpf, interpretations, letter_rpf, published};
use super::method::Method;
use super::scene_results::{
    BASE_OF_GROWTH, EQUAL_TIME, INTERPRETATION, LETTER, NLM, OUTSIDE, PRPF, REFERENCE, RPF, SceneResults,
    TIME_OVER_RPF, UNFILTERED, UPSAMPLING, at, beside, brightness_of_side, mse_of_side,
};
use super::settings::{SceneSettings, Settings};
use super::weight_maps;
use crate::ledger::{Key, Values, values};
use crate::picture;
use crate::reference::Reference;
use crate::sampling;
use crate::session::Session;

/// The seed of runs that only measure times.
const PILOT_SEED: u64 = 1000;
/// Folder of the pictures, in the folder of the results.
pub const PICTURES: &str = "pictures";

/// A crop of a scene, with what its measurements need.
pub struct CropMeasurement<'a> {
    pub settings: &'a Settings,
    pub scene_settings: &'a SceneSettings,
    /// The scene, whose film is the crop with its margin.
    pub scene: &'a Scene,
    pub accel: &'a Accel<'a>,
    pub crop: Crop,
    /// The pixels of the reference, on the film: the crop, or more around it.
    pub whole: Bounds,
    pub reference: &'a Reference,
    /// Folder of the pictures.
    pub pictures: &'a Path,
    /// The samples of the latest run, which the next run may share.
    pub samples: Option<Samples>,
}

/// Samples of a crop with its margin.
pub struct Samples {
    spp: u32,
    capacity: usize,
    seed: u64,
    store: Store,
    /// Seconds of rendering.
    seconds: f64,
}

impl CropMeasurement<'_> {
    /// The key of a run, with the settings that all runs depend on.
    fn key(&self, run: &str, spp: u32, seed: u64) -> Key {
        let Settings { margin, reference_spp, .. } = *self.settings;
        let settings = format!(
            "run={} spp={spp} sigma8={} crop={:?} of={:?} margin={margin} reference={reference_spp}",
            run.replace(' ', "-"),
            self.scene_settings.sigma8_squared,
            self.crop.inner,
            self.whole
        );
        Key::new(&self.scene_settings.name, seed, settings)
    }

    /// Runs all methods but RPF, and measures everything else that does not need it.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn measure_all_but_rpf(
        &mut self,
        session: &mut Session,
        results: &mut SceneResults,
    ) -> anyhow::Result<()> {
        // Record the reference's error
        let Reference { mse, relmse, spp, .. } = *self.reference;
        let (pixels, film) = (area(self.crop.inner), self.scene.film.width * self.scene.film.height);
        let reference_values = [
            ("mse", mse),
            ("relmse", relmse),
            ("pixels of the crop", pixels as f64),
            ("pixels of the image", film as f64),
        ];
        let key = self.key(REFERENCE, spp, 0);
        results.add(REFERENCE, session.ledger.measure(key, &[], || Ok(values(reference_values)))?);

        // Run the methods at every sample count
        let sigma8_squared = self.scene_settings.sigma8_squared;
        for &spp in &self.settings.spp {
            for seed in 0..self.settings.seeds {
                for (name, method) in cheap_methods(sigma8_squared) {
                    let run = at(name, spp);
                    let values = self.run(session, (&run, &method), (spp, seed), None)?;
                    results.add(run, values);
                }
            }
        }

        // Run everything that is measured at the base sample count
        let seeds = self.settings.interpretation_seeds;
        self.interpretations(session, results, seeds, |method| !matches!(method, Method::Rpf(_)))?;
        for seed in 0..seeds {
            self.upsampling(seed, session, results)?;
        }
        self.outside(session, results)
    }

    /// Runs RPF, and every other method beside it, at the sample counts whose square has this side; on the square of the largest count
    /// also RPF at the base count, to tell how its time grows; at the base count also its other interpretations, and every other
    /// method in its time.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn measure_rpf(
        &mut self,
        side: usize,
        session: &mut Session,
        results: &mut SceneResults,
    ) -> anyhow::Result<()> {
        let Settings { base_spp, rpf_interpretation_seeds: seeds, .. } = *self.settings;
        let sigma8_squared = self.scene_settings.sigma8_squared;
        let all = results.rpf_runs.clone();
        for runs in all.iter().filter(|runs| runs.side == side) {
            let spp = runs.spp;
            for seed in 0..runs.seeds {
                let picture = (spp == base_spp && seed == 0).then_some(RPF);
                let rpf = Method::Rpf(compared_rpf(sigma8_squared));
                let values = self.run(session, (&at(RPF, spp), &rpf), (spp, seed), picture)?;
                results.add(at(RPF, spp), values);
                for (name, method) in cheap_methods(sigma8_squared) {
                    let run = beside(name, spp);
                    let values = self.run(session, (&run, &method), (spp, seed), None)?;
                    results.add(run, values);
                }
                if spp > base_spp && Some(spp) == results.max_rpf_spp() {
                    let values = self.run(session, (BASE_OF_GROWTH, &rpf), (base_spp, seed), None)?;
                    results.add(BASE_OF_GROWTH, values);
                }
            }

            // Run it to the letter at the second count too, to tell whether its error falls
            if Some(spp) == all.get(1).map(|runs| runs.spp) {
                for seed in 0..seeds {
                    let (run, method) = (at(LETTER, spp), Method::Rpf(letter_rpf(sigma8_squared)));
                    let values = self.run(session, (&run, &method), (spp, seed), None)?;
                    results.add(run, values);
                }
            }
        }
        if all.iter().any(|runs| runs.side == side && runs.spp == base_spp) {
            let reference = self.reference_of(self.crop.inner);
            let name = &self.scene_settings.name;
            let path = self.pictures.join(format!("{name}-reference.png"));
            picture::write(&path, &reference.image, self.scene_settings.exposure)?;
            self.interpretations(session, results, seeds, |method| matches!(method, Method::Rpf(_)))?;
            self.equal_time(session, results)?;
        }
        Ok(())
    }

    /// Runs those interpretations of the papers that are `wanted`.
    fn interpretations(
        &mut self,
        session: &mut Session,
        results: &mut SceneResults,
        seeds: u64,
        wanted: impl Fn(&Method) -> bool,
    ) -> anyhow::Result<()> {
        let base_spp = self.settings.base_spp;
        for seed in 0..seeds {
            for (name, method) in interpretations(self.scene_settings.sigma8_squared) {
                if wanted(&method) {
                    let run = format!("{INTERPRETATION} {name}");
                    let values = self.run(session, (&run, &method), (base_spp, seed), None)?;
                    results.add(run, values);
                }
            }
        }
        Ok(())
    }

    /// Runs a method with a seed at a sample count. Writes the image as a picture if a name is given.
    fn run(
        &mut self,
        session: &mut Session,
        (run, method): (&str, &Method),
        (spp, seed): (u32, u64),
        picture: Option<&str>,
    ) -> anyhow::Result<Values> {
        session.show_status(format!("{}: {run}, {spp} spp, seed {seed}", self.scene_settings.name));
        let path = |name| self.pictures.join(format!("{}-{name}.png", self.scene_settings.name));
        let files: Vec<PathBuf> = picture.map(path).into_iter().collect();
        let key = self.key(run, spp, seed);
        session.ledger.measure(key, &files, || {
            let samples = self.samples(spp, method.capacity(spp), seed);
            let render_seconds = samples.seconds;
            let (image, mut values) = method.run(&samples.store, seed);
            let megapixels = 1e-6 * self.crop.pixels() as f64;
            values.insert("render seconds".to_owned(), render_seconds);
            for (quantity, value) in &mut values {
                if quantity.ends_with("seconds") {
                    *value /= megapixels;
                }
            }
            let image = picture::crop(&image, self.crop.inner_in_outer());
            values.extend(self.errors(&image)?);
            values.insert("spp".to_owned(), f64::from(spp));
            for file in &files {
                picture::write(file, &image, self.scene_settings.exposure)?;
            }
            Ok(values)
        })
    }

    /// Compares the crop of an image with the reference, as a whole and on the squares of RPF.
    fn errors(&self, image: &Planes) -> anyhow::Result<Values> {
        let reference = self.reference_of(self.crop.inner);
        let relmse = reference.relmse_of(image);
        let flip = Pair::new(image, &reference.image)?.flip().mean;
        let mut errors = values([("mse", reference.mse_of(image)), ("relmse", relmse), ("flip", flip)]);
        let [x0, x1, y0, y1] = self.crop.inner;
        for runs in self.settings.rpf_runs(self.scene_settings) {
            let side = runs.side;
            if side > (x1 - x0).min(y1 - y0) {
                continue;
            }
            let square = middle(self.whole, (side, side));
            let image = picture::crop(image, relative(square, self.crop.inner));
            let reference = self.reference_of(square);
            errors.insert(mse_of_side(side), reference.mse_of(&image));
            errors.insert(brightness_of_side(side), Pair::new(&image, &reference.image)?.mean_ratio());
        }
        Ok(errors)
    }

    /// The reference of some pixels of the film.
    fn reference_of(&self, pixels: Bounds) -> Reference {
        self.reference.cropped(relative(pixels, self.whole))
    }

    /// The samples of the crop with its margin; renders them unless the latest run has them.
    fn samples(&mut self, spp: u32, capacity: usize, seed: u64) -> &Samples {
        let is_latest =
            |latest: &Samples| (latest.spp, latest.capacity, latest.seed) == (spp, capacity, seed);
        let latest = self.samples.take().filter(is_latest);
        self.samples.insert(latest.unwrap_or_else(|| {
            let renderer = Renderer::new(self.scene, self.accel, seed);
            let mut store = sampling::store(&renderer, capacity, seed);
            let seconds = sampling::add(&renderer, &mut store, spp);
            Samples { spp, capacity, seed, store, seconds }
        }))
    }

    /// Runs every other method in the time, sampling included, that RPF takes at the base sample count on the same pixels.
    fn equal_time(&mut self, session: &mut Session, results: &mut SceneResults) -> anyhow::Result<()> {
        // Estimate the affordable sample counts by the times beside RPF, and refine them by pilot runs of a quarter as many
        let Settings { base_spp: base, max_equal_time_spp: max_spp, .. } = *self.settings;
        let time = total_seconds(|quantity| results.at(RPF, base, quantity));
        if !time.is_finite() {
            return Ok(());
        }
        let mut runs = Vec::new();
        for (name, method) in cheap_methods(self.scene_settings.sigma8_squared) {
            let known = |quantity: &str| results.get(&beside(name, base), quantity);
            let guess = affordable(time, known, base, max_spp);
            let quarter = (guess / 4).next_multiple_of(2).max(2);
            let pilot =
                self.run(session, (&format!("pilot {name}"), &method), (quarter, PILOT_SEED), None)?;
            runs.push((name, method, affordable(time, |quantity| pilot[quantity], quarter, max_spp)));
        }

        // Record the reference's error on these pixels, and run the methods
        let Reference { mse, relmse, spp, .. } = self.reference_of(self.crop.inner);
        let (run, own) = (format!("{EQUAL_TIME} {REFERENCE}"), values([("mse", mse), ("relmse", relmse)]));
        results.add(&run, session.ledger.measure(self.key(&run, spp, 0), &[], || Ok(own))?);
        for seed in 0..self.scene_settings.equal_time_seeds {
            for (name, method, spp) in &runs {
                let run = format!("{EQUAL_TIME} {name}");
                let picture = (seed == 0).then_some(*name);
                let mut values = self.run(session, (&run, method), (*spp, seed), picture)?;
                let time_over_rpf = total_seconds(|quantity| values[quantity]) / time;
                values.insert(TIME_OVER_RPF.to_owned(), time_over_rpf);
                results.add(run, values);
            }
        }
        Ok(())
    }

    /// Measures P-RPF with and without upsampling of weights: times of the weights and of the filter, and errors.
    /// The weights and their pictures are those of the first seed.
    fn upsampling(
        &mut self,
        seed: u64,
        session: &mut Session,
        results: &mut SceneResults,
    ) -> anyhow::Result<()> {
        let spp = self.settings.base_spp;
        let name = &self.scene_settings.name;
        session.show_status(format!("{name}: upsampling"));
        let is_first = seed == 0;
        let maps =
            (is_first && self.scene_settings.weight_maps).then(|| weight_maps::files(self.pictures, name));
        let files: Vec<PathBuf> = maps.clone().into_iter().flatten().collect();
        let key = self.key(UPSAMPLING, spp, seed);
        let (inner, reference) = (self.crop.inner_in_outer(), self.reference);
        let sigma8_squared = self.scene_settings.sigma8_squared;
        let values = session.ledger.measure(key, &files, || {
            let store = &self.samples(spp, spp as usize, seed).store;
            let with = published(sigma8_squared);
            let without = pixelwise::PrpfSettings { upsampling: false, ..with.clone() };
            let mut result = Values::new();
            for (name, settings) in [("with", &with), ("without", &without)] {
                let (image, values) = Method::Prpf(settings.clone()).run(store, seed);
                let image = picture::crop(&image, inner);
                result.insert(format!("mse {name}"), reference.mse_of(&image));
                result.insert(format!("seconds {name}"), values["seconds"]);
                result.insert(format!("weight seconds {name}"), values["weight seconds"]);
                result.extend(
                    values.get("interpolated").map(|&fraction| ("interpolated".to_owned(), fraction)),
                );
            }
            result.insert("added mse".to_owned(), result["mse with"] - result["mse without"]);
            if is_first {
                let (names, interpolated) = pixelwise::feature_weights(store, &with, seed);
                let (_, direct) = pixelwise::feature_weights(store, &without, seed);
                let threshold = with.interpolation_threshold;
                result.insert("weights mse".to_owned(), weights_mse(&interpolated, &direct, threshold));
                if let Some(files) = &maps {
                    let rpf = compared_rpf(sigma8_squared);
                    weight_maps::write(files, &names, [&interpolated[0], &direct[0]], store, &rpf, seed)?;
                }
            }
            Ok(result)
        })?;
        results.add(UPSAMPLING, values);
        Ok(())
    }

    /// Measures, for each window, the fraction of samples beyond the similarity threshold in a selection by pixels.
    fn outside(&mut self, session: &mut Session, results: &mut SceneResults) -> anyhow::Result<()> {
        let spp = self.settings.base_spp;
        let key = self.key(OUTSIDE, spp, 0);
        let settings = published(self.scene_settings.sigma8_squared);
        let values = session.ledger.measure(key, &[], || {
            let store = &self.samples(spp, spp as usize, 0).store;
            let fractions = settings.windows.iter().map(|&window| {
                (format!("window {window}"), pixelwise::dissimilar_fraction(store, &settings, window))
            });
            Ok(fractions.collect())
        })?;
        results.add(OUTSIDE, values);
        Ok(())
    }
}

/// All methods but RPF, with their names.
fn cheap_methods(sigma8_squared: f32) -> [(&'static str, Method); 3] {
    [(UNFILTERED, Method::Unfiltered), (PRPF, Method::Prpf(published(sigma8_squared))), (NLM, Method::Nlm)]
}

/// The seconds of sampling and filter together, of a run with these values.
fn total_seconds(quantity: impl Fn(&str) -> f64) -> f64 {
    quantity("render seconds") + quantity("seconds")
}

/// The number of samples per pixel that fit into some seconds if a run of `spp` has these values: even, because of the halves, and at
/// least 2.
fn affordable(seconds: f64, values: impl Fn(&str) -> f64, spp: u32, max_spp: u32) -> u32 {
    let per_sample = values("render seconds") / f64::from(spp);
    let spp = ((seconds - values("seconds")) / per_sample).clamp(2.0, f64::from(max_spp)) as u32;
    spp - spp % 2
}

/// Mean squared difference between interpolated and directly computed weights, over passes, weights and the pixels
/// where they were interpolated. The last plane holds the sums of the interpolation weights.
fn weights_mse(interpolated: &[Planes], direct: &[Planes], threshold: f32) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for (interpolated, direct) in interpolated.iter().zip(direct) {
        // The planes after β and α hold W_c^r, which is no weight, and the sums.
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
    fn the_error_of_weights_counts_interpolated_ones_alone() {
        let mut with = planes(0.5, [1.0, 0.05, f32::INFINITY]);
        with.plane_mut(0)[1] = 9.0;
        with.plane_mut(0)[2] = 9.0;
        let without = planes(0.25, [f32::INFINITY; 3]);
        assert_eq!(weights_mse(&[with], &[without], 0.1), 0.0625);
    }

    #[test]
    fn an_affordable_number_of_samples_is_even() {
        let affordable = |seconds, per_sample: f64| {
            let values = |quantity: &str| if quantity == "seconds" { 3.0 } else { 8.0 * per_sample };
            affordable(seconds, values, 8, 100)
        };
        assert_eq!(affordable(11.0, 0.25), 32);
        assert_eq!(affordable(11.0, 0.24), 32);
        assert_eq!(affordable(11.0, 1e-3), 100);
        assert_eq!(affordable(2.0, 1.0), 2);
    }
}
