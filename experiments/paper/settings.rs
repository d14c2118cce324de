//! What `paper.toml` says.

use serde::Deserialize;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    pub seed: u64,
    /// Samples per pixel at which the methods are compared.
    pub spp: Vec<u32>,
    /// Samples per pixel of the random parameter filtering that others get the time of, and of everything
    /// that is measured at one count only. One of `spp`.
    pub base_spp: u32,
    /// Pixels around each crop that are rendered and filtered with it, and not compared.
    pub margin: usize,
    /// Share of each crop's width and height that is taken, from its middle.
    pub crop_share: f64,
    pub reference_spp: u32,
    /// Random parameter filtering is not run beyond this, whatever a scene allows.
    pub most_rpf_spp: u32,
    /// Ceiling of the samples per pixel at equal time.
    pub most_equal_time_spp: u32,
    /// Filters that take a fraction of a second are run so often, and the median time is kept.
    pub repeats: usize,
    /// Samples per pixel of whole images; 0 leaves them out.
    pub whole_spp: u32,
    pub scenes: Vec<SceneSettings>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSettings {
    /// As in `scenes.toml`.
    pub name: String,
    /// What is compared: x0, x1, y0, y1 in pixels, half open.
    pub crop: [usize; 4],
    /// Random parameter filtering is not run beyond this many samples per pixel.
    pub most_rpf_spp: u32,
    /// σ₈² of both methods: 0.02 for path-traced indoor scenes, 0.002 otherwise.
    pub sigma8_squared: f32,
    /// One of the paper's four scenes, or what stands in for it.
    #[serde(default)]
    pub of_paper: bool,
    /// For pictures, in stops.
    #[serde(default)]
    pub exposure: f32,
    /// Show its weights as pictures.
    #[serde(default)]
    pub weight_pictures: bool,
}
