//! The settings of the experiment `paper`, from `paper.toml`.

use serde::Deserialize;

/// The settings of the experiment.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    pub seed: u64,
    /// Samples per pixel at which the methods are compared.
    pub spp: Vec<u32>,
    /// Samples per pixel of the RPF whose time the other methods get, and of everything that is measured at one
    /// sample count. One of `spp`.
    pub base_spp: u32,
    /// Pixels around each crop that are rendered and filtered, but not compared.
    pub margin: usize,
    /// Fraction of each crop's width and height that is used, in its middle.
    pub crop_fraction: f64,
    pub reference_spp: u32,
    /// Maximum samples per pixel of RPF on any scene.
    pub max_rpf_spp: u32,
    /// Maximum samples per pixel at equal time.
    pub max_equal_time_spp: u32,
    /// Runs of each filter but RPF. Times are their median.
    pub repeats: usize,
    /// Samples per pixel of whole images; 0 leaves them out.
    pub whole_spp: u32,
    pub scenes: Vec<SceneSettings>,
}

/// The settings of one scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSettings {
    /// Name in `scenes.toml`.
    pub name: String,
    /// The compared pixels: x0, x1, y0, y1, half open.
    pub crop: [usize; 4],
    /// Maximum samples per pixel of RPF.
    pub max_rpf_spp: u32,
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
