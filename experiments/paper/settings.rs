//! The settings of the experiment `paper`, from `paper.toml`.

use serde::Deserialize;

use super::crop::{Bounds, middle};

/// The settings of the experiment.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Number of seeds on the crop, of every method but RPF; beside RPF all have RPF's. Seeds count from 0.
    pub seeds: u64,
    /// Number of seeds of other interpretations of P-RPF, and of P-RPF without upsampling.
    pub interpretation_seeds: u64,
    /// Number of seeds of other interpretations of RPF.
    pub rpf_interpretation_seeds: u64,
    /// Samples per pixel at which the methods are compared.
    pub spp: Vec<u32>,
    /// Samples per pixel of the RPF whose time the other methods get, and of everything that is measured at one
    /// sample count. One of `spp`.
    pub base_spp: u32,
    /// Pixels around each crop that are rendered and filtered, but not compared.
    pub margin: usize,
    /// Fraction of the width and height of every crop that is used, in its middle.
    pub crop_fraction: f64,
    pub reference_spp: u32,
    /// Runs of RPF on each scene that lists none of its own.
    pub rpf: Vec<RpfRuns>,
    /// Maximum samples per pixel and number of seeds of RPF on any scene.
    pub max_rpf_spp: u32,
    pub max_rpf_seeds: u64,
    /// Maximum samples per pixel at equal time.
    pub max_equal_time_spp: u32,
    /// Samples per pixel of whole images; 0 leaves them out.
    pub whole_spp: u32,
    pub scenes: Vec<SceneSettings>,
}

/// Runs of RPF at a sample count.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RpfRuns {
    pub spp: u32,
    pub seeds: u64,
    /// Side in pixels of the compared square in the middle of the crop.
    pub side: usize,
}

/// The settings of one scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSettings {
    /// Name in `scenes.toml`.
    pub name: String,
    /// The compared pixels: x0, x1, y0, y1, half open.
    pub crop: Bounds,
    /// Runs of RPF, in place of [`Settings::rpf`].
    pub rpf: Option<Vec<RpfRuns>>,
    /// Number of seeds at equal time.
    #[serde(default = "one")]
    pub equal_time_seeds: u64,
    /// σ₈² of both methods: 0.02 for path-traced indoor scenes, 0.002 otherwise.
    pub sigma8_squared: f32,
    /// Whether it is one of the paper's four scenes, or a stand-in for one.
    #[serde(default)]
    pub from_paper: bool,
    /// Exposure of pictures, in stops.
    #[serde(default)]
    pub exposure: f32,
    /// Whether to draw its feature weights.
    #[serde(default)]
    pub weight_maps: bool,
}

fn one() -> u64 {
    1
}

impl Settings {
    /// The compared pixels of a scene.
    pub fn inner(&self, scene: &SceneSettings) -> Bounds {
        let [x0, x1, y0, y1] = scene.crop;
        let scaled = |side: usize| (side as f64 * self.crop_fraction).round() as usize;
        middle(scene.crop, (scaled(x1 - x0), scaled(y1 - y0)))
    }

    /// The runs of RPF on a scene, in ascending order of sample counts.
    pub fn rpf_runs(&self, scene: &SceneSettings) -> Vec<RpfRuns> {
        let [x0, x1, y0, y1] = self.inner(scene);
        let mut runs = scene.rpf.clone().unwrap_or_else(|| self.rpf.clone());
        runs.retain(|run| run.spp <= self.max_rpf_spp && self.spp.contains(&run.spp));
        runs.sort_by_key(|run| run.spp);
        for run in &mut runs {
            let side = (run.side as f64 * self.crop_fraction).round() as usize;
            run.side = side.clamp(1, (x1 - x0).min(y1 - y0));
            run.seeds = run.seeds.min(self.max_rpf_seeds);
        }
        runs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(quick: bool) -> Settings {
        crate::settings::read(&crate::settings::package_folder().join("paper.toml"), quick).unwrap()
    }

    #[test]
    fn runs_of_rpf_are_limited_and_scaled() {
        let mut settings = settings(false);
        let runs = |spp, seeds, side| RpfRuns { spp, seeds, side };
        settings.rpf = vec![runs(16, 3, 40), runs(8, 5, 64), runs(64, 2, 20)];
        let scene = SceneSettings { crop: [100, 228, 0, 128], rpf: None, ..settings.scenes[0].clone() };
        assert_eq!(settings.rpf_runs(&scene), [runs(8, 5, 64), runs(16, 3, 40), runs(64, 2, 20)]);
        (settings.crop_fraction, settings.max_rpf_spp, settings.max_rpf_seeds) = (0.5, 16, 2);
        assert_eq!(settings.inner(&scene), [132, 196, 32, 96]);
        assert_eq!(settings.rpf_runs(&scene), [runs(8, 2, 32), runs(16, 2, 20)]);
        let own = SceneSettings { rpf: Some(vec![runs(8, 1, 500)]), ..scene };
        assert_eq!(settings.rpf_runs(&own), [runs(8, 1, 64)]);
    }

    #[test]
    fn every_scene_runs_rpf_at_the_base_count() {
        for settings in [settings(false), settings(true)] {
            assert!(settings.spp.contains(&settings.base_spp));
            for scene in &settings.scenes {
                assert_eq!(settings.rpf_runs(scene)[0].spp, settings.base_spp, "{}", scene.name);
            }
        }
    }
}
