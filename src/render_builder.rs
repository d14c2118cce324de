//! Builds and runs a render in one expression, for programs that use the library.
//!
//! Takes a scene and, step by step, whatever differs from the defaults; gives an image that can be written to files.

use std::path::Path;
use std::time::Instant;

use crate::adaptive::Sampling;
use crate::filter::Denoiser;
use crate::geometry::Accel;
use crate::image::{ImageError, Planes};
use crate::output::{ImageOutput, Layers};
use crate::progressive::{
    self, Checkpoint, Host, MemoryError, Outcome, RenderLoop, Settings, SettingsError, fits_in_memory,
};
use crate::render::Renderer;
use crate::scene::{Scene, ValidationError};
use crate::state::{ImageMetadata, RenderState};
use crate::stats::BlockSet;

/// A render to come. Without a budget the scene's samples per pixel are rendered.
#[must_use]
pub struct RenderBuilder<'a> {
    scene: &'a Scene,
    accel: Option<&'a Accel<'a>>,
    settings: Settings,
    reference: Option<&'a Planes>,
    checkpoint: Option<Checkpoint>,
    start: Instant,
}

/// Why a render cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    #[error("scene: {0}")]
    Scene(#[from] ValidationError),
    #[error("settings: {0}")]
    Settings(#[from] SettingsError),
    #[error(transparent)]
    Memory(#[from] MemoryError),
    #[error("{what}: found {found}; accepted is that of the scene, {accepted}")]
    Differs { what: &'static str, found: String, accepted: String },
}

/// A finished render, with what its files say of the scene.
pub struct RenderedImage {
    pub outcome: Outcome,
    pub metadata: ImageMetadata,
}

impl RenderedImage {
    /// Writes the image: `.exr` with all layers, `.png` tone-mapped.
    ///
    /// # Errors
    /// Those of the file system, and another extension.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), ImageError> {
        ImageOutput::new(&self.outcome, &self.metadata).write(path.as_ref())
    }
}

impl<'a> RenderBuilder<'a> {
    /// A render of the scene by default settings, whose time counts from now.
    pub fn new(scene: &'a Scene) -> Self {
        let start = Instant::now();
        Self { scene, accel: None, settings: Settings::default(), reference: None, checkpoint: None, start }
    }

    /// Uses an acceleration structure that was built of the same scene, instead of building one.
    pub fn accel(self, accel: &'a Accel<'a>) -> Self {
        Self { accel: Some(accel), ..self }
    }

    /// Replaces all settings.
    pub fn settings(self, settings: Settings) -> Self {
        Self { settings, ..self }
    }

    /// Ends the render at `spp` samples per pixel, on average.
    pub fn spp(mut self, spp: u32) -> Self {
        self.settings.budget.spp = Some(spp);
        self
    }

    /// Ends the render `seconds` seconds after [`Self::new`], the last filter pass included.
    pub fn seconds(mut self, seconds: f64) -> Self {
        self.settings.budget.seconds = Some(seconds);
        self
    }

    /// Ends the render when the estimated relMSE has fallen to this.
    pub fn target_error(mut self, error: f64) -> Self {
        self.settings.budget.target_error = Some(error);
        self
    }

    /// Chooses how samples are spread over the pixels.
    pub fn sampling(mut self, sampling: Sampling) -> Self {
        self.settings.sampling = sampling;
        self
    }

    /// Chooses the denoiser: one of [`crate::filter::DENOISERS`], or one of the program's own.
    pub fn denoiser(mut self, denoiser: &'static dyn Denoiser) -> Self {
        self.settings.denoiser = denoiser;
        self
    }

    /// Chooses the seed of all random numbers.
    pub fn seed(mut self, seed: u64) -> Self {
        self.settings.seed = seed;
        self
    }

    /// Compares every filtered image with a reference of 3 planes.
    pub fn reference(self, reference: &'a Planes) -> Self {
        Self { reference: Some(reference), ..self }
    }

    /// Goes on from a checkpoint of the same scene and seed.
    pub fn resume(self, checkpoint: Checkpoint) -> Self {
        Self { checkpoint: Some(checkpoint), ..self }
    }

    /// Returns the blocks of dimensions of which the render will keep statistics: those of the checkpoint from which it goes on,
    /// or what the settings call for. `keeps_checkpoints`: whether its host keeps some, which a state file then holds.
    fn recorded_blocks(&self, keeps_checkpoints: bool) -> BlockSet {
        if let Some(checkpoint) = &self.checkpoint {
            return checkpoint.store.layout().blocks();
        }
        let layers = Layers::blocks_read(None);
        let outputs = if keeps_checkpoints { layers | RenderState::blocks_kept() } else { layers };
        self.settings.recorded_blocks(outputs)
    }

    /// Renders on rayon's current thread pool.
    ///
    /// # Errors
    /// A scene or settings that no render can follow, a reference or a checkpoint of another image, too little memory.
    pub fn run(self) -> Result<RenderedImage, RenderError> {
        self.run_with(&mut ())
    }

    /// As [`Self::run`], with a host that listens, interrupts, and keeps checkpoints.
    ///
    /// # Errors
    /// Those of [`Self::run`].
    pub fn run_with(mut self, host: &mut dyn Host) -> Result<RenderedImage, RenderError> {
        // Check scene and settings
        self.scene.validate()?;
        if self.settings.budget == Default::default() {
            self.settings.budget.spp = Some(self.scene.spp);
        }
        self.settings.validate()?;
        let keeps_checkpoints = host.checkpoint_interval().is_some();
        let recorded = self.recorded_blocks(keeps_checkpoints);
        let settings = self.settings;
        let built;
        let accel = match self.accel {
            Some(accel) => accel,
            None => {
                built = Accel::build(self.scene);
                &built
            }
        };
        let whole = Renderer::new(self.scene, accel, settings.seed);
        let renderer = whole.recording(recorded);
        let size = renderer.resolution();
        fits_in_memory(renderer.layout(), &settings, size, keeps_checkpoints, 1)?;

        // Check that everything is of this scene
        let check = |what, found: String, accepted: String| match found == accepted {
            true => Ok(()),
            false => Err(RenderError::Differs { what, found, accepted }),
        };
        let size = |(width, height): (usize, usize)| format!("{width}x{height} pixels");
        let resolution = size(renderer.resolution());
        if let Some(reference) = self.reference {
            check("reference", size((reference.width(), reference.height())), resolution.clone())?;
        }
        if let Some(Checkpoint { store, .. }) = &self.checkpoint {
            let names = |layout: &crate::stats::Layout| {
                layout.dimensions().iter().map(|dimension| dimension.name).collect::<Vec<_>>().join(" ")
            };
            check("checkpoint", size((store.width(), store.height())), resolution)?;
            check("checkpoint's layout", names(store.layout()), names(renderer.layout()))?;
        }

        // Render
        let render_loop = match self.checkpoint {
            Some(checkpoint) => RenderLoop::resume(&renderer, &settings, self.start, checkpoint),
            None => RenderLoop::new(&renderer, &settings, self.start),
        };
        let outcome = progressive::run(render_loop.with_reference(self.reference), host);
        Ok(RenderedImage { outcome, metadata: ImageMetadata::new(self.scene, &renderer) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::pbrt::read_str;

    const SCENE: &str = r#"Film "rgb" "integer xresolution" [ 12 ] "integer yresolution" [ 8 ]
        Sampler "independent" "integer pixelsamples" [ 3 ]
        WorldBegin LightSource "infinite" Translate 0 0 4 Shape "sphere""#;

    fn scene() -> Scene {
        read_str(SCENE, Path::new("")).expect("the test's scene is right")
    }

    #[test]
    fn a_render_is_built_and_written() {
        let scene = scene();
        let image = RenderBuilder::new(&scene).sampling(Sampling::Uniform).run().expect("it renders");
        assert_eq!(image.outcome.store.samples(), 3 * 12 * 8, "the scene's samples per pixel");
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.exr", "a.png"] {
            image.write(folder.path().join(name)).unwrap();
        }
        assert!(image.write(folder.path().join("a.bmp")).is_err());
    }

    #[test]
    fn an_acceleration_structure_that_is_given_makes_the_same_image() {
        let scene = scene();
        let accel = Accel::build(&scene);
        let built = RenderBuilder::new(&scene).run().expect("it renders");
        let given = RenderBuilder::new(&scene).accel(&accel).run().expect("it renders");
        assert_eq!(given.outcome.result.image, built.outcome.result.image);
    }

    #[test]
    fn what_does_not_fit_the_scene_is_an_error() {
        let scene = scene();
        let error = |builder: RenderBuilder| builder.run().err().expect("an error").to_string();
        assert!(error(RenderBuilder::new(&scene).spp(0)).contains("spp: found 0"));
        let reference = Planes::new(5, 5, 3);
        let message = error(RenderBuilder::new(&scene).reference(&reference));
        assert!(message.contains("found 5x5 pixels") && message.contains("12x8"), "{message}");
        let layout = crate::stats::Layout::with_blocks(|_| true);
        let checkpoint = Checkpoint::new(crate::stats::Store::new(12, 8, layout, 0, 0));
        assert!(error(RenderBuilder::new(&scene).resume(checkpoint)).contains("layout"));
    }
}
