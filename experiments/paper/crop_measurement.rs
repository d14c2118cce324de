//! Measures all methods on a crop of a scene.

use std::path::PathBuf;

use prpf::filter::prpf as pixelwise;
use prpf::image::Planes;
use prpf::image::metrics::Pair;
use prpf::render::Renderer;
use prpf::stats::Store;

use super::crop::Crop;
use super::interpretations::{interpretations, published, published_rpf};
use super::method::Method;
use super::scene_results::{
    EQUAL_TIME, INTERPRETATION, NLM, OUTSIDE, PRPF, REFERENCE, RPF, SceneResults, UNFILTERED, UPSAMPLING,
};
use super::settings::{SceneSettings, Settings};
use super::weight_maps;
use crate::ledger::{Key, Values, values};
use crate::picture;
use crate::reference::Reference;
use crate::sampling;
use crate::session::Session;

/// Folder of the pictures, in the folder of the results.
pub const PICTURES: &str = "pictures";

/// A crop of a scene, with what its measurements need.
pub struct CropMeasurement<'a> {
    pub settings: &'a Settings,
    pub scene_settings: &'a SceneSettings,
    /// Renders the crop with its margin.
    pub renderer: &'a Renderer<'a>,
    pub crop: Crop,
    /// Number of pixels of the whole image.
    pub film_pixels: usize,
    /// The reference of the crop without its margin.
    pub reference: &'a Reference,
    /// Folder of the pictures.
    pub pictures: PathBuf,
}

impl CropMeasurement<'_> {
    /// The key of a run, with the settings that all runs depend on.
    fn key(&self, run: &str) -> Key {
        let Settings { seed, margin, reference_spp, .. } = *self.settings;
        let settings = format!(
            "{run} sigma8={} crop={:?} margin={margin} reference={reference_spp}",
            self.scene_settings.sigma8_squared, self.crop.inner
        );
        Key::new(&self.scene_settings.name, seed, settings)
    }

    /// Takes all measurements of the crop.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn measure(&self, session: &mut Session, results: &mut SceneResults) -> anyhow::Result<()> {
        // Record the reference's error
        let Settings { base_spp, .. } = *self.settings;
        let Reference { mse, relmse, spp, .. } = *self.reference;
        let reference_values = [
            ("mse", mse),
            ("relmse", relmse),
            ("spp", f64::from(spp)),
            ("pixels of the crop", self.crop.pixels() as f64),
            ("pixels of the image", self.film_pixels as f64),
        ];
        let recorded = session.ledger.measure(self.key(REFERENCE), &[], || Ok(values(reference_values)))?;
        results.runs.insert(REFERENCE.to_owned(), recorded);

        // Run every method at every sample count, RPF as far as its time allows
        let max_rpf_spp = self.scene_settings.max_rpf_spp.min(self.settings.max_rpf_spp);
        results.rpf_spp = self.settings.spp.iter().copied().filter(|&spp| spp <= max_rpf_spp).collect();
        let sigma8_squared = self.scene_settings.sigma8_squared;
        for &spp in &self.settings.spp {
            let mut methods = vec![
                (UNFILTERED, Method::Unfiltered),
                (PRPF, Method::Prpf(published(sigma8_squared))),
                (NLM, Method::Nlm),
            ];
            if spp <= max_rpf_spp {
                methods.push((RPF, Method::Rpf(published_rpf(sigma8_squared))));
            }
            for (name, method) in &methods {
                let run = format!("{name} {spp}");
                let picture = (*name == RPF && spp == base_spp).then_some(RPF);
                let values = self.run(session, &run, method, spp, picture)?;
                results.runs.insert(run, values);
            }
        }

        // Run everything that is measured at the base sample count
        self.equal_time(session, results)?;
        for (name, method) in interpretations(sigma8_squared) {
            let run = format!("{INTERPRETATION} {name}");
            let values = self.run(session, &run, &method, base_spp, None)?;
            results.runs.insert(run, values);
        }
        self.upsampling(session, results)?;
        self.outside(session, results)
    }

    /// Runs a method at a sample count. Writes the image as a picture if a name is given.
    fn run(
        &self,
        session: &mut Session,
        run: &str,
        method: &Method,
        spp: u32,
        picture: Option<&str>,
    ) -> anyhow::Result<Values> {
        session.show_status(format!("{}: {run}, {spp} spp", self.scene_settings.name));
        let path = |name| self.pictures.join(format!("{}-{name}.png", self.scene_settings.name));
        let files: Vec<PathBuf> = picture.map(path).into_iter().collect();
        let key = self.key(&format!("run={} spp={spp}", run.replace(' ', "-")));
        session.ledger.measure(key, &files, || {
            let (store, render) = self.samples(spp, method.capacity(spp));
            let (image, mut values) = method.run(&store, self.settings.seed, self.settings.repeats);
            let image = picture::crop(&image, self.crop.inner_in_outer());
            let pair = Pair::new(&image, &self.reference.image)?;
            values.insert("render seconds".to_owned(), render);
            values.insert("mse".to_owned(), pair.mse());
            values.insert("relmse".to_owned(), pair.relmse());
            values.insert("flip".to_owned(), pair.flip().mean);
            values.insert("spp".to_owned(), f64::from(spp));
            for file in &files {
                picture::write(file, &image, self.scene_settings.exposure)?;
            }
            Ok(values)
        })
    }

    /// Renders a store; also returns the elapsed seconds.
    fn samples(&self, spp: u32, capacity: usize) -> (Store, f64) {
        let mut store = sampling::store(self.renderer, capacity, self.settings.seed);
        let seconds = sampling::add(self.renderer, &mut store, spp);
        (store, seconds)
    }

    /// Runs every other method in the time, sampling included, that RPF takes at the base sample count.
    fn equal_time(&self, session: &mut Session, results: &mut SceneResults) -> anyhow::Result<()> {
        let base = self.settings.base_spp;
        let total = |method: &str, spp: u32| {
            results.at(method, spp, "render seconds") + results.at(method, spp, "seconds")
        };
        let time = total(RPF, base);
        if !time.is_finite() {
            return Ok(());
        }
        // Find the affordable sample counts. The largest count gives the best estimate of a sample's time.
        let largest = self.settings.spp.iter().copied().max().unwrap_or(base);
        let mut equal = Vec::new();
        for (name, method) in [
            (PRPF, Method::Prpf(published(self.scene_settings.sigma8_squared))),
            (NLM, Method::Nlm),
            (UNFILTERED, Method::Unfiltered),
        ] {
            let per_sample = results.at(name, largest, "render seconds") / f64::from(largest);
            let filter = results.at(name, largest, "seconds");
            equal.push((
                name,
                method,
                affordable(time - filter, per_sample, self.settings.max_equal_time_spp),
            ));
        }

        // Run the methods
        for (name, method, spp) in equal {
            let run = format!("{EQUAL_TIME} {name}");
            let values = self.run(session, &run, &method, spp, Some(name))?;
            results.runs.insert(run, values);
        }
        Ok(())
    }

    /// Measures P-RPF with and without upsampling of weights: times of the weights and of the filter, and errors.
    fn upsampling(&self, session: &mut Session, results: &mut SceneResults) -> anyhow::Result<()> {
        let (spp, seed) = (self.settings.base_spp, self.settings.seed);
        let name = &self.scene_settings.name;
        session.show_status(format!("{name}: upsampling"));
        let maps = self.scene_settings.weight_maps.then(|| weight_maps::files(&self.pictures, name));
        let files: Vec<PathBuf> = maps.clone().into_iter().flatten().collect();
        let key = self.key(&format!("{UPSAMPLING} spp={spp}"));
        let values = session.ledger.measure(key, &files, || {
            let (store, _) = self.samples(spp, spp as usize);
            let with = published(self.scene_settings.sigma8_squared);
            let without = pixelwise::PrpfSettings { upsampling: false, ..with.clone() };
            let mut result = Values::new();
            for (name, settings) in [("with", &with), ("without", &without)] {
                let (image, values) = Method::Prpf(settings.clone()).run(&store, seed, 1);
                let image = picture::crop(&image, self.crop.inner_in_outer());
                result.insert(format!("mse {name}"), Pair::new(&image, &self.reference.image)?.mse());
                result.insert(format!("seconds {name}"), values["seconds"]);
                result.insert(format!("weight seconds {name}"), values["weight seconds"]);
                result.extend(
                    values.get("interpolated").map(|&fraction| ("interpolated".to_owned(), fraction)),
                );
            }
            let (names, interpolated) = pixelwise::feature_weights(&store, &with, seed);
            let (_, direct) = pixelwise::feature_weights(&store, &without, seed);
            let threshold = with.interpolation_threshold;
            result.insert("weights mse".to_owned(), weights_mse(&interpolated, &direct, threshold));
            if let Some(files) = &maps {
                let rpf = published_rpf(self.scene_settings.sigma8_squared);
                weight_maps::write(files, &names, [&interpolated[0], &direct[0]], &store, &rpf, seed)?;
            }
            Ok(result)
        })?;
        results.runs.insert(UPSAMPLING.to_owned(), values);
        Ok(())
    }

    /// Measures, for each window, the fraction of samples beyond the similarity threshold in a selection by pixels.
    fn outside(&self, session: &mut Session, results: &mut SceneResults) -> anyhow::Result<()> {
        let spp = self.settings.base_spp;
        let key = self.key(&format!("{OUTSIDE} spp={spp}"));
        let values = session.ledger.measure(key, &[], || {
            let (store, _) = self.samples(spp, spp as usize);
            let settings = published(self.scene_settings.sigma8_squared);
            let fractions = settings.windows.iter().map(|&window| {
                (format!("window {window}"), pixelwise::dissimilar_fraction(&store, &settings, window))
            });
            Ok(fractions.collect())
        })?;
        results.runs.insert(OUTSIDE.to_owned(), values);
        Ok(())
    }
}

/// The number of samples per pixel that fit into some seconds: even, because of the halves, and at least 2.
fn affordable(seconds: f64, per_sample: f64, max_spp: u32) -> u32 {
    let spp = (seconds / per_sample).clamp(2.0, f64::from(max_spp)) as u32;
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
        assert_eq!(affordable(8.0, 0.25, 100), 32);
        assert_eq!(affordable(8.0, 0.24, 100), 32);
        assert_eq!(affordable(8.0, 1e-3, 100), 100);
        assert_eq!(affordable(-1.0, 1.0, 100), 2);
    }
}
