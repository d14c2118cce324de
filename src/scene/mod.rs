//! The scene as data: camera, film, shapes, materials, textures and lights.
//!
//! [`pbrt`] reads a [`Scene`] from a scene description. Positions are in *render space*: world space
//! translated in f64 so that the camera at shutter open is at the origin. A scene far from the world's
//! origin therefore loses no precision when its positions are rounded to `f32`.

pub mod camera;
mod color_space;
pub mod effects;
pub mod film;
pub mod integrator;
pub mod light;
pub mod material;
pub mod material_traits;
pub mod measured_brdf;
pub mod pbrt;
pub mod sampler_kind;
pub mod shape;
pub mod texture;
pub mod transform;
pub mod validation;

pub use camera::Camera;
pub use effects::Effects;
pub use film::{Film, PixelFilter};
pub use integrator::Integrator;
pub use light::{AreaLight, Light};
pub use material::{Material, MaterialId, MaterialKind};
pub use material_traits::MaterialTraits;
pub use sampler_kind::SamplerKind;
pub use shape::{Disk, Instance, MeshTangents, Object, Primitive, Shape, Sphere, TriangleMesh};
pub use texture::{FloatTextureId, ImageId, RgbTextureId, TextureImage, Textures};
pub use transform::AnimatedTransform;
pub use validation::ValidationError;

/// A complete scene, ready to be rendered.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Path of the scene file as given; empty for a scene made in memory.
    pub source: String,
    /// Dialect of the scene file; `None` for a scene made in memory.
    pub dialect: Option<pbrt::Dialect>,
    /// SHA-256 in hexadecimal; empty for a scene made in memory.
    ///
    /// It covers the scene file and the files it includes in the order of reading, each preceded by its
    /// length (64 bits, little endian), then the length and CRC-32 (little endian) of every mesh, image,
    /// spectrum and BRDF file in the order of their first reference.
    pub hash: String,
    /// All files of the scene; empty for a scene made in memory.
    pub files: Vec<std::path::PathBuf>,
    /// World position of render space's origin.
    pub origin: glam::DVec3,
    pub camera: Camera,
    pub film: Film,
    pub integrator: Integrator,
    pub sampler: SamplerKind,
    /// Samples per pixel that the scene requests.
    pub spp: u32,
    pub textures: Textures,
    /// Indexed by [`MaterialId`].
    pub materials: Vec<Material>,
    /// All primitives of all objects.
    pub primitives: Vec<Primitive>,
    /// `objects[0]` is the static part of the scene in render space; it has no entry in `instances`. The
    /// others appear once per instance.
    pub objects: Vec<Object>,
    pub instances: Vec<Instance>,
    /// Lights without a surface; the [`AreaLight`] of a surface is in `primitives`.
    pub lights: Vec<Light>,
    /// Warnings of the reader, one line each, with the location.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Whether the scene has a light.
    pub fn is_lit(&self) -> bool {
        !self.lights.is_empty() || self.primitives.iter().any(|primitive| primitive.area_light.is_some())
    }

    /// Changes the film's resolution. Pixel bounds are scaled, and a screen window that fits the film's
    /// aspect ratio is refitted.
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
}
