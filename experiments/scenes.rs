//! Looks up scenes by name in `scenes.toml` and loads them.
//!
//! Gives a [`Scene`] with the film resolution, crop and integrator that an experiment asks for.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use prpf::scene::{Integrator, Scene, pbrt};
use serde::Deserialize;

use crate::settings;

/// An entry of `scenes.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    pub name: String,
    pub file: PathBuf,
    /// Whether the file belongs to the folder of public scenes, not to this repository.
    #[serde(default, rename = "public")]
    pub is_public: bool,
    /// Width and height in pixels. Overrides the file's.
    resolution: Option<[usize; 2]>,
    /// Maximum path depth of a path tracer. Overrides the file's integrator.
    path_depth: Option<u32>,
}

/// The resolution and the crop of a scene's film. The default is the whole film at the scene's resolution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// Factor for the resolution.
    pub scale: Option<f64>,
    /// Pixels of the scaled film, x0, x1, y0, y1, half open.
    pub crop: Option<[usize; 4]>,
}

/// The scenes of `scenes.toml`.
pub struct Catalogue {
    scenes: Vec<SceneFile>,
}

#[derive(Deserialize)]
struct Listed {
    scene: Vec<SceneFile>,
}

impl Catalogue {
    /// Reads the list. Paths of public scenes are relative to the folder `public`, those of the project's own
    /// to the folder above that of the list.
    ///
    /// # Errors
    /// See [`settings::read`].
    pub fn read(list: &Path, public: Option<PathBuf>) -> anyhow::Result<Self> {
        let Listed { scene: mut scenes } = settings::read(list, false)?;
        let public = public.unwrap_or_default();
        let repository = list.parent().and_then(Path::parent).unwrap_or(Path::new(""));
        for scene in &mut scenes {
            scene.file = if scene.is_public { &public } else { repository }.join(&scene.file);
        }
        Ok(Self { scenes })
    }

    /// The scene of this name.
    ///
    /// # Errors
    /// A name that the list lacks.
    pub fn scene(&self, name: &str) -> anyhow::Result<SceneFile> {
        let found = self.scenes.iter().find(|scene| scene.name == name);
        found.cloned().with_context(|| format!("scenes.toml has no scene named {name}"))
    }
}

impl SceneFile {
    /// Reads the scene and sets its film to the view.
    ///
    /// # Errors
    /// A file that cannot be read, a crop outside the film, or a scene without lights.
    pub fn load(&self, view: View) -> anyhow::Result<Scene> {
        let mut scene = pbrt::read(&self.file).with_context(|| self.file.display().to_string())?;
        if let Some(max_depth) = self.path_depth {
            scene.integrator = Integrator::Path { max_depth };
        }
        let [width, height] = self.resolution.unwrap_or([scene.film.width, scene.film.height]);
        let scaled = |size: usize| (size as f64 * view.scale.unwrap_or(1.0)).round().max(1.0) as usize;
        scene.resize_film(scaled(width), scaled(height));
        if let Some(crop) = view.crop {
            let (width, height) = (scene.film.width, scene.film.height);
            let [x0, x1, y0, y1] = crop;
            ensure!(
                x0 < x1 && y0 < y1 && x1 <= width && y1 <= height,
                "{}: found a crop of {crop:?}; accepted are crops of its {width}x{height} pixels",
                self.name
            );
            scene.film.pixel_bounds = crop;
        }
        if !scene.is_lit() {
            bail!("{}: the scene has no light", self.name);
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn catalogue(public: Option<PathBuf>) -> Catalogue {
        Catalogue::read(&settings::package_folder().join("scenes.toml"), public).unwrap()
    }

    fn pool() -> SceneFile {
        catalogue(None).scene("pool").unwrap()
    }

    #[test]
    fn a_view_crops_the_scaled_film() {
        let view = View { scale: Some(0.25), crop: Some([10, 50, 20, 70]) };
        let film = pool().load(view).unwrap().film;
        assert_eq!((film.width, film.height, film.pixel_bounds), (128, 128, [10, 50, 20, 70]));
        let whole = pool().load(View::default()).unwrap().film;
        assert_eq!(whole.pixel_bounds, [0, whole.width, 0, whole.height]);
    }

    #[test]
    fn a_crop_outside_the_film_is_refused() {
        let outside = View { crop: Some([0, 10, 500, 600]), ..View::default() };
        assert!(pool().load(outside).unwrap_err().to_string().contains("512x512"));
    }

    #[test]
    fn public_scenes_are_in_their_folder() {
        let catalogue = catalogue(Some("somewhere".into()));
        let buddha = catalogue.scene("buddha").unwrap();
        assert_eq!(buddha.file, Path::new("somewhere/pbrt-v2/buddha.pbrt"));
        assert!(catalogue.scene("nothing").is_err());
    }
}
