//! The metadata of an image, as a state file and the outputs describe it.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::render::Renderer;
use crate::scene::pbrt::camera_directives;
use crate::scene::{Camera, Integrator, Scene};

fn directives(camera: &Camera, origin: DVec3, [width, height]: [usize; 2]) -> String {
    camera_directives(camera, origin, width as f32 / height as f32)
}

/// The metadata of an image: what identifies its scene and its view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageMetadata {
    /// Path of the scene file, as in [`Scene::source`].
    pub source: String,
    /// Hash of the scene, as in [`Scene::hash`].
    pub hash: String,
    /// Width and height of the whole film, in pixels.
    pub film: [usize; 2],
    /// Bounds of the rendered part of the film: x0, x1, y0, y1 in pixels, half open.
    pub pixel_bounds: [usize; 4],
    /// Name and maximum depth of the integrator.
    pub integrator: String,
    /// Names of the effects that the scene calls for.
    pub effects: Vec<String>,
    /// The camera, as directives of a scene file; empty in states of earlier versions.
    #[serde(default)]
    pub camera: String,
    /// World-space position of the origin of render space.
    pub origin: [f64; 3],
    /// Diameter of the scene, by which positions in the store are divided, in scene units.
    pub diameter: f32,
}

/// Largest relative difference of diameters that rounding explains, as of two versions of the program.
const DIAMETER_ROUNDING: f32 = 1e-5;

impl ImageMetadata {
    /// Collects the metadata of an image that `renderer` makes of `scene`.
    pub fn new(scene: &Scene, renderer: &Renderer) -> Self {
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
            camera: directives(&scene.camera, scene.origin, [scene.film.width, scene.film.height]),
            origin: scene.origin.to_array(),
            diameter: renderer.diameter(),
        }
    }

    /// Returns the metadata of an image that another camera sees.
    pub fn with_camera(&self, camera: &Camera) -> Self {
        let camera = directives(camera, self.origin.into(), self.film);
        Self { camera, ..self.clone() }
    }

    /// Returns width and height of the rendered part, in pixels; `None` if its bounds are not within the film.
    pub fn resolution(&self) -> Option<[usize; 2]> {
        let [x0, x1, y0, y1] = self.pixel_bounds;
        let inside = x0 <= x1 && y0 <= y1 && x1 <= self.film[0] && y1 <= self.film[1];
        inside.then(|| [x1 - x0, y1 - y0])
    }

    /// Returns the first field in which two images differ such that their samples cannot be mixed: its name, the value
    /// of `other`, and the value of `self`.
    pub fn difference(&self, other: &Self) -> Option<(&'static str, String, String)> {
        let film = |image: &Self| format!("{}x{}", image.film[0], image.film[1]);
        let bounds = |image: &Self| image.pixel_bounds.map(|at| at.to_string()).join(",");
        let scene = |image: &Self| format!("{} ({:.12})", image.source, image.hash);
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
                (self.diameter - other.diameter).abs() <= DIAMETER_ROUNDING * self.diameter,
                other.diameter.to_string(),
                self.diameter.to_string(),
            ),
        ];
        fields.into_iter().find(|(_, same, ..)| !same).map(|(name, _, theirs, ours)| (name, theirs, ours))
    }
}
