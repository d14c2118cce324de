//! What a state says of itself before its arrays: text, so that people and scripts can read it.

use serde::{Deserialize, Serialize};

use super::Stream;
use crate::progressive::{Batch, Grain, Settings};
use crate::render::Renderer;
use crate::scene::{Integrator, Scene};

/// What is known of the picture without its scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// As in [`Scene`].
    pub source: String,
    /// As in [`Scene`].
    pub hash: String,
    /// Resolution of the whole film, in pixels.
    pub film: [usize; 2],
    /// The part of it that is rendered: x0, x1, y0, y1 in pixels, half open.
    pub pixel_bounds: [usize; 4],
    /// Name and depth.
    pub integrator: String,
    /// Names of the effects that the scene calls for.
    pub effects: Vec<String>,
    /// World position of render space's origin.
    pub origin: [f64; 3],
    /// What positions in the store are divided by, in scene units.
    pub diameter: f32,
}

impl Frame {
    pub fn of(scene: &Scene, renderer: &Renderer) -> Self {
        let integrator = match scene.integrator {
            Integrator::Path { max_depth } => format!("path, depth {max_depth}"),
            Integrator::Direct { max_depth } => format!("direct, depth {max_depth}"),
        };
        Self {
            source: scene.source.clone(),
            hash: scene.hash.clone(),
            film: [scene.film.width, scene.film.height],
            pixel_bounds: scene.film.pixel_bounds,
            integrator,
            effects: scene.effects().names().into_iter().map(str::to_owned).collect(),
            origin: scene.origin.to_array(),
            diameter: renderer.diameter(),
        }
    }

    /// Width and height of what is rendered, in pixels; `None` if the bounds are not in the film.
    pub fn resolution(&self) -> Option<[usize; 2]> {
        let [x0, x1, y0, y1] = self.pixel_bounds;
        let inside = x0 <= x1 && y0 <= y1 && x1 <= self.film[0] && y1 <= self.film[1];
        inside.then(|| [x1 - x0, y1 - y0])
    }

    /// The first thing in which two pictures differ, such that their samples cannot be mixed: its name,
    /// what the other has, and what this one has.
    pub fn difference(&self, other: &Self) -> Option<(&'static str, String, String)> {
        let film = |frame: &Self| format!("{}x{}", frame.film[0], frame.film[1]);
        let bounds = |frame: &Self| frame.pixel_bounds.map(|at| at.to_string()).join(",");
        let scene = |frame: &Self| format!("{} ({:.12})", frame.source, frame.hash);
        let fields = [
            ("scene", self.hash == other.hash, scene(other), scene(self)),
            ("resolution", self.film == other.film, film(other), film(self)),
            ("pixelbounds", self.pixel_bounds == other.pixel_bounds, bounds(other), bounds(self)),
            (
                "integrator",
                self.integrator == other.integrator,
                other.integrator.clone(),
                self.integrator.clone(),
            ),
            ("effects", self.effects == other.effects, other.effects.join(", "), self.effects.join(", ")),
            (
                "diameter",
                self.diameter == other.diameter,
                other.diameter.to_string(),
                self.diameter.to_string(),
            ),
        ];
        fields.into_iter().find(|(_, same, ..)| !same).map(|(name, _, theirs, ours)| (name, theirs, ours))
    }
}

/// All of a state but its arrays, whose presence and sizes follow from it.
#[derive(Serialize, Deserialize)]
pub(super) struct Header {
    /// Of the program that wrote it.
    pub program: String,
    pub frame: Frame,
    pub settings: Settings,
    pub streams: Vec<Stream>,
    /// Names of the sample vector's dimensions.
    pub dimensions: Vec<String>,
    /// Sample vectors kept per pixel at most.
    pub capacity: usize,
    pub batches: Vec<Batch>,
    pub recent: (f64, f64),
    pub estimate: Option<EstimateHeader>,
    pub rerun: Option<RerunHeader>,
    pub under_way: Option<UnderWayHeader>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct EstimateHeader {
    pub image: f64,
    pub standard_error: f64,
    pub samples: u64,
}

#[derive(Serialize, Deserialize)]
pub(super) struct RerunHeader {
    /// Whether there is a map of interpolation failures.
    pub failure: bool,
    pub success: Option<f32>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct UnderWayHeader {
    pub done: f64,
    pub grain: Grain,
}
