//! Scenes: reading them, and rendering samples of them into a store.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use prpf::geometry::Accel;
use prpf::render::{Renderer, sample_layout};
use prpf::scene::film::{MAX_PIXELS, MAX_SIDE};
use prpf::scene::integrator::MAX_DEPTH;
use prpf::scene::{self, pbrt};
use prpf::state::ImageMetadata;
use prpf::stats::{Columns, Layout};
use pyo3::prelude::*;
use self_cell::self_cell;

use crate::arguments;
use crate::arrays;
use crate::errors::{Error, open_failure, scene_error, value_error};
use crate::store::Store;

/// Samples that are rendered between two looks at signals: a fraction of a second in most scenes.
const STEP_SAMPLES: u64 = 1 << 17;

self_cell!(
    /// A scene with its acceleration structure, which borrows from it.
    struct SceneWithAccel {
        owner: Arc<scene::Scene>,
        #[covariant]
        dependent: Accel,
    }
);

/// See `__init__.pyi`.
#[pyclass(frozen, module = "prpf")]
pub struct Scene {
    pub scene: Arc<scene::Scene>,
    /// Built when first needed; see [`Self::accel`].
    accel: OnceLock<SceneWithAccel>,
}

impl Scene {
    fn new(
        mut scene: scene::Scene,
        resolution: Option<[usize; 2]>,
        pixel_bounds: Option<[usize; 4]>,
        max_depth: Option<u32>,
    ) -> PyResult<Self> {
        if let Some([width, height]) = resolution {
            let is_accepted = |side: usize| (1..=MAX_SIDE as usize).contains(&side);
            if !is_accepted(width) || !is_accepted(height) || (width * height) as u64 > MAX_PIXELS {
                return Err(value_error(format!(
                    "resolution: found {width}x{height}; accepted are sides from 1 to {MAX_SIDE} and at most \
                     {MAX_PIXELS} pixels"
                )));
            }
            scene.resize_film(width, height);
        }
        if let Some([x0, x1, y0, y1]) = pixel_bounds {
            let (width, height) = (scene.film.width, scene.film.height);
            if x0 >= x1 || y0 >= y1 || x1 > width || y1 > height {
                return Err(value_error(format!(
                    "pixel_bounds: found ({x0}, {x1}, {y0}, {y1}); accepted are 0 <= x0 < x1 <= {width} and \
                     0 <= y0 < y1 <= {height}"
                )));
            }
            scene.film.pixel_bounds = [x0, x1, y0, y1];
        }
        if let Some(depth) = max_depth {
            if depth > MAX_DEPTH {
                return Err(value_error(format!(
                    "max_depth: found {depth}; accepted is a number from 0 to {MAX_DEPTH}"
                )));
            }
            scene.integrator = scene.integrator.with_max_depth(depth);
        }
        scene.validate().map_err(|error| Error::new_err(format!("scene: {error}")))?;
        Ok(Self { scene: Arc::new(scene), accel: OnceLock::new() })
    }

    /// Returns the scene's acceleration structure, which the first call builds.
    pub fn accel(&self) -> &Accel<'_> {
        let build = || SceneWithAccel::new(self.scene.clone(), |scene| Accel::build(scene));
        self.accel.get_or_init(build).borrow_dependent()
    }

    /// Returns a renderer of the scene's samples of one seed.
    pub fn renderer(&self, seed: u64) -> Renderer<'_> {
        Renderer::new(&self.scene, self.accel(), seed)
    }

    fn layout(&self, py: Python) -> Layout {
        py.detach(|| sample_layout(&self.scene.effects()))
    }

    /// Returns width and height of what is rendered.
    pub fn size(&self) -> (usize, usize) {
        let [x0, x1, y0, y1] = self.scene.film.pixel_bounds;
        (x1 - x0, y1 - y0)
    }
}

/// Moves the samples of the next step from `left` to `now`, both of the pixels of a band. Returns whether there are some: if
/// not, `now` is all 0.
fn take_step(left: &mut [u32], now: &mut [u32]) -> bool {
    let open = left.iter().filter(|&&count| count > 0).count() as u64;
    // Where few pixels are open, each gets many samples: every step passes over the counts of the whole image
    let most = (STEP_SAMPLES / open.max(1)).max(1) as u32;
    for (now, left) in now.iter_mut().zip(left) {
        *now = most.min(*left);
        *left -= *now;
    }
    open > 0
}

#[pymethods]
impl Scene {
    /// Reads a pbrt scene.
    #[staticmethod]
    #[pyo3(signature = (path, *, resolution=None, pixel_bounds=None, max_depth=None))]
    fn load(
        py: Python,
        path: PathBuf,
        #[pyo3(from_py_with = arguments::wholes_or_none)] resolution: Option<[usize; 2]>,
        #[pyo3(from_py_with = arguments::wholes_or_none)] pixel_bounds: Option<[usize; 4]>,
        #[pyo3(from_py_with = arguments::whole_or_none)] max_depth: Option<u32>,
    ) -> PyResult<Self> {
        py.detach(|| {
            let scene = pbrt::read(&path).map_err(|error| scene_error(error, open_failure(&path)))?;
            Self::new(scene, resolution, pixel_bounds, max_depth)
        })
    }

    /// Reads a scene from a text in pbrt's format; file names in it are relative to `folder`.
    #[staticmethod]
    #[pyo3(signature = (text, folder=PathBuf::new(), *, resolution=None, pixel_bounds=None, max_depth=None))]
    fn parse(
        py: Python,
        text: &str,
        folder: PathBuf,
        #[pyo3(from_py_with = arguments::wholes_or_none)] resolution: Option<[usize; 2]>,
        #[pyo3(from_py_with = arguments::wholes_or_none)] pixel_bounds: Option<[usize; 4]>,
        #[pyo3(from_py_with = arguments::whole_or_none)] max_depth: Option<u32>,
    ) -> PyResult<Self> {
        py.detach(|| {
            let scene = pbrt::read_str(text, &folder).map_err(|error| scene_error(error, None))?;
            Self::new(scene, resolution, pixel_bounds, max_depth)
        })
    }

    /// Width of the rendered image in pixels.
    #[getter]
    fn width(&self) -> usize {
        self.size().0
    }

    /// Height of the rendered image in pixels.
    #[getter]
    fn height(&self) -> usize {
        self.size().1
    }

    /// Width and height of the whole film in pixels.
    #[getter]
    fn resolution(&self) -> (usize, usize) {
        (self.scene.film.width, self.scene.film.height)
    }

    /// The part of the film that is rendered: x0, x1, y0, y1 in pixels, half open.
    #[getter]
    fn pixel_bounds(&self) -> (usize, usize, usize, usize) {
        self.scene.film.pixel_bounds.into()
    }

    /// The largest number of scattering events of a path.
    #[getter]
    fn max_depth(&self) -> u32 {
        self.scene.integrator.max_depth()
    }

    /// Samples per pixel that the scene asks for.
    #[getter]
    fn spp(&self) -> u32 {
        self.scene.spp
    }

    /// Names of the effects that the scene calls for.
    #[getter]
    fn effects(&self, py: Python) -> Vec<&'static str> {
        py.detach(|| self.scene.effects()).names()
    }

    /// Names of the dimensions of a sample.
    #[getter]
    fn dimensions(&self, py: Python) -> Vec<&'static str> {
        self.layout(py).names().collect()
    }

    /// Warnings of the reader, one line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scene.warnings.clone()
    }

    /// Returns an empty store for samples of this scene.
    #[pyo3(signature = (*, reservoir=0, seed=0))]
    fn store(
        &self,
        py: Python,
        #[pyo3(from_py_with = arguments::whole)] reservoir: usize,
        #[pyo3(from_py_with = arguments::whole)] seed: u64,
    ) -> PyResult<Store> {
        let (width, height) = self.size();
        Store::empty(py, width, height, Columns::from_layout(self.layout(py)), reservoir, seed)
    }

    /// Adds samples to a store: `counts` to every pixel, or to each its own.
    fn render(&self, py: Python, store: &Store, counts: &Bound<PyAny>) -> PyResult<()> {
        // Check that the store is one of this scene
        let (width, height) = self.size();
        let found = store.statistics(py);
        if (found.width(), found.height()) != (width, height) {
            return Err(value_error(format!(
                "store: found {}x{} pixels; accepted is the size of the scene, {width}x{height}",
                found.width(),
                found.height()
            )));
        }
        if *found.layout() != self.layout(py) {
            let found = found.layout().names().collect::<Vec<_>>().join(" ");
            let accepted = self.dimensions(py).join(" ");
            return Err(value_error(format!(
                "store: found the dimensions {found}; accepted are those of the scene, {accepted}"
            )));
        }
        if !store.can_go_on {
            return Err(value_error(
                "store: found one with samples of a shard; accepted is one whose sample sequences have no gaps",
            ));
        }
        // A store that is still read would be copied
        drop(found);
        let mut counts = arrays::counts("counts", counts, [height, width])?;

        // Render in steps, of bands of rows if the image is large: signals are looked at between two
        let (renderer, metadata) = py.detach(|| {
            let renderer = self.renderer(store.seed);
            let metadata = ImageMetadata::new(&self.scene, &renderer);
            (renderer, metadata)
        });
        store.check_image(&metadata)?;
        let band = (STEP_SAMPLES as usize / width).max(1) * width;
        let mut now = vec![0; width * height];
        for first in (0..width * height).step_by(band) {
            let band = first..(first + band).min(width * height);
            while take_step(&mut counts[band.clone()], &mut now[band.clone()]) {
                store.add(py, |store| renderer.render_batch(&now, store));
                py.check_signals()?;
            }
        }
        Ok(())
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.size();
        format!("<prpf.Scene {:?}, {width}x{height} pixels>", self.scene.source)
    }
}
