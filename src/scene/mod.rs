//! What is in the picture, as data: no rays, no samples.
//!
//! A [`Scene`] is made by [`pbrt`] from a scene description. Its positions are in *render space*:
//! world space moved so that the camera (at shutter open) stands at the origin, in f64, before
//! anything becomes `f32`. So a scene far from the world's origin loses no precision.

pub mod camera;
pub mod effects;
pub mod film;
pub mod light;
pub mod material;
pub mod measured;
pub mod pbrt;
pub mod shape;
pub mod texture;
pub mod transform;

pub use camera::Camera;
pub use effects::Effects;
pub use film::{Film, PixelFilter};
pub use light::{AreaLight, Light};
pub use material::{Material, MaterialId, MaterialKind};
pub use shape::{Disk, Instance, Object, Primitive, Shape, Sphere, TriangleMesh};
pub use texture::{FloatTextureId, ImageId, RgbTextureId, TextureImage, Textures};
pub use transform::AnimatedTransform;

/// Which light-transport algorithm the scene asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// Path tracing with up to `max_depth` scattering events (pbrt's `path`, `volpath`).
    Path { max_depth: u32 },
    /// Light that reaches the camera by one scattering event, or along chains of perfectly
    /// specular ones of at most `max_depth` (pbrt-v2's `directlighting`; pbrt-v4's `simplepath`
    /// has no equivalent).
    Direct { max_depth: u32 },
}

impl Integrator {
    /// The largest number of scattering events of a path.
    pub fn max_depth(self) -> u32 {
        match self {
            Integrator::Path { max_depth } | Integrator::Direct { max_depth } => max_depth,
        }
    }
}

/// Where a sample's numbers come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplerKind {
    /// Owen-scrambled Sobol' points, the default; also for pbrt's `zsobol`, `paddedsobol`,
    /// `halton`, `stratified`, `pmj02bn`, `lowdiscrepancy`.
    Sobol,
    /// Independent uniform numbers (pbrt's `independent`, v2's `random`).
    Independent,
}

/// A whole scene, ready to be rendered.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The path it was read from, as given; empty for scenes made in memory.
    pub source: String,
    /// As which dialect it was read; none for scenes made in memory.
    pub dialect: Option<pbrt::Dialect>,
    /// SHA-256, in hexadecimal, of the scene file and those it includes, in the order of reading, each
    /// after its length (64-bit little endian), then of length and CRC-32 (little endian) of every mesh, image,
    /// spectrum and BRDF they name, in the order of their first names. Empty for scenes made in memory.
    pub hash: String,
    /// Every file that it was read from. Empty for scenes made in memory.
    pub files: Vec<std::path::PathBuf>,
    /// World position of render space's origin.
    pub origin: glam::DVec3,
    pub camera: Camera,
    pub film: Film,
    pub integrator: Integrator,
    pub sampler: SamplerKind,
    /// Samples per pixel that the scene asks for.
    pub spp: u32,
    pub textures: Textures,
    /// Indexed by [`MaterialId`].
    pub materials: Vec<Material>,
    /// All primitives of all objects.
    pub primitives: Vec<Primitive>,
    /// `objects[0]` is the static part of the scene, already in render space and present once
    /// without an entry in `instances`; the others appear where `instances` puts them.
    pub objects: Vec<Object>,
    pub instances: Vec<Instance>,
    /// Lights that are not surfaces; emissive surfaces carry their [`AreaLight`] in `primitives`.
    pub lights: Vec<Light>,
    /// What was read but is not simulated: one line each, with its place.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Whether anything shines.
    pub fn is_lit(&self) -> bool {
        !self.lights.is_empty() || self.primitives.iter().any(|primitive| primitive.area_light.is_some())
    }

    /// Gives the film another resolution; the part that is rendered keeps its share of it, and a
    /// screen window that fits the film's aspect goes on fitting it.
    pub fn resize_film(&mut self, width: usize, height: usize) {
        let film = &mut self.film;
        let fitted = |width, height| camera::fitted_screen_window(width as f32 / height as f32);
        if self.camera.screen_window == fitted(film.width, film.height) {
            self.camera.screen_window = fitted(width, height);
        }
        let [x0, x1, y0, y1] = film.pixel_bounds;
        let scale = |at: usize, from: usize, to: usize| at * to / from.max(1);
        let (x0, x1) = (scale(x0, film.width, width), scale(x1, film.width, width));
        let (y0, y1) = (scale(y0, film.height, height), scale(y1, film.height, height));
        film.pixel_bounds =
            [x0.min(width - 1), x1.max(x0 + 1).min(width), y0.min(height - 1), y1.max(y0 + 1).min(height)];
        (film.width, film.height) = (width, height);
    }

    /// The effects this scene calls for; everything a render simulates follows from them.
    pub fn effects(&self) -> Effects {
        Effects::of(self)
    }
}
