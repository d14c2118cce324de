//! Pixel statistics: taking samples in, and reading moments as arrays.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use numpy::PyUntypedArrayMethods;
use prpf::image::Planes;
use prpf::progressive::{StoreSizeError, check_store_size};
use prpf::render::Shard;
use prpf::state::{ImageMetadata, RenderState};
use prpf::stats::{self, Columns, HalfMoments, Layout, Part, SampleRectangle};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

use crate::arguments;
use crate::arrays;
use crate::errors::{state_error, value_error};

/// See `__init__.pyi`.
#[pyclass(frozen, module = "prpf")]
pub struct Store {
    /// Copied only if it changes while another call or a pass of a callback still reads it.
    store: Mutex<Arc<stats::Store>>,
    pub seed: u64,
    /// The columns of the samples that are pushed.
    columns: Columns,
    /// Whether the renderer can go on: it cannot after a shard's samples, some of which it would take again.
    pub can_go_on: bool,
    /// The image that the renderer's samples are of; not set before it has taken some.
    metadata: OnceLock<ImageMetadata>,
}

impl Store {
    /// Creates an empty store, if it fits in memory.
    pub fn empty(
        py: Python,
        width: usize,
        height: usize,
        columns: Columns,
        reservoir: usize,
        seed: u64,
    ) -> PyResult<Self> {
        check_size(&columns, [width, height], reservoir)?;
        let layout = columns.layout().clone();
        let store = py.detach(|| stats::Store::new(width, height, layout, reservoir, seed));
        Ok(Self::from_parts(Arc::new(store), columns, seed))
    }

    /// Wraps a store of the renderer's samples of an image.
    pub fn wrap(store: Arc<stats::Store>, metadata: ImageMetadata, seed: u64) -> Self {
        let columns = Columns::from_layout(store.layout().clone());
        Self { metadata: metadata.into(), ..Self::from_parts(store, columns, seed) }
    }

    /// Takes the store of a state.
    pub fn from_state(state: RenderState) -> Self {
        let can_go_on = state.streams.iter().all(|stream| stream.shard == Shard::WHOLE);
        Self { can_go_on, ..Self::wrap(state.checkpoint.store, state.metadata, state.settings.seed) }
    }

    fn from_parts(store: Arc<stats::Store>, columns: Columns, seed: u64) -> Self {
        Self { store: Mutex::new(store), seed, columns, can_go_on: true, metadata: OnceLock::new() }
    }

    /// Checks that the renderer's samples in the store are of this image, from now on if there are none.
    ///
    /// # Errors
    /// The first thing in which the images differ.
    pub fn check_image(&self, metadata: &ImageMetadata) -> PyResult<()> {
        match metadata.difference(self.metadata.get_or_init(|| metadata.clone())) {
            None => Ok(()),
            Some((field, found, accepted)) => {
                // A scene from a text has no name before its hash
                let (found, accepted) = (found.trim_start(), accepted.trim_start());
                Err(value_error(format!(
                    "store: {field}: found samples of {found}; accepted are those of this scene, {accepted}"
                )))
            }
        }
    }

    /// Returns the statistics of the samples so far. Waits for calls of other threads that add some.
    pub fn statistics(&self, py: Python) -> Arc<stats::Store> {
        py.detach(|| self.lock().clone())
    }

    /// Adds samples. Calls of other threads wait.
    pub fn add<T: Send>(&self, py: Python, add: impl FnOnce(&mut stats::Store) -> T + Send) -> T {
        py.detach(|| add(Arc::make_mut(&mut self.lock())))
    }

    /// Never waits with the GIL, which the thread that holds the lock may need.
    fn lock(&self) -> MutexGuard<'_, Arc<stats::Store>> {
        self.store.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads a function of the moments of the dimensions that `names` selects.
    fn read(
        &self,
        py: Python,
        names: Option<&Bound<PyAny>>,
        half: Option<usize>,
        read: impl Fn(&stats::Store, Part, Vec<usize>) -> Planes + Send + Sync,
    ) -> PyResult<Py<PyAny>> {
        let store = self.statistics(py);
        let dimensions = select(store.layout(), names)?;
        let part = part(half)?;
        let planes = py.detach(|| read(&store, part, dimensions));
        arrays::image(py, planes)
    }
}

/// Checks that a store of this size has pixels and fits in memory.
fn check_size(columns: &Columns, [width, height]: [usize; 2], reservoir: usize) -> PyResult<()> {
    check_store_size(columns.layout(), (width, height), reservoir).map_err(|error| match error {
        StoreSizeError::Size(..) => value_error(error),
        StoreSizeError::Memory(error) => PyMemoryError::new_err(error.to_string()),
    })
}

fn part(half: Option<usize>) -> PyResult<Part> {
    match half {
        None => Ok(Part::Whole),
        Some(half @ (0 | 1)) => Ok(Part::Half(half)),
        Some(half) => Err(value_error(format!("half: found {half}; accepted are 0, 1 and None"))),
    }
}

/// Returns the dimensions of some names: whole ones (`N1.x`), what comes before their point (`N1`), or `RGB`; all for `None`.
fn select(layout: &Layout, names: Option<&Bound<PyAny>>) -> PyResult<Vec<usize>> {
    let Some(names) = names else { return Ok((0..layout.len()).collect()) };
    let names = match names.extract::<String>() {
        Ok(name) => vec![name],
        Err(_) => arguments::names(names)?,
    };
    let mut selected = Vec::new();
    for name in &names {
        let is_selected = |dimension: &str| {
            dimension == name
                || dimension.split_once('.').is_some_and(|(block, _)| block == name)
                || (name == "RGB" && ["R", "G", "B"].contains(&dimension))
        };
        let before = selected.len();
        selected.extend(layout.names().enumerate().filter(|(_, name)| is_selected(name)).map(|(dim, _)| dim));
        if selected.len() == before {
            let accepted = layout.names().collect::<Vec<_>>().join(", ");
            return Err(value_error(format!("names: found `{name}`; accepted are RGB, {accepted}")));
        }
    }
    Ok(selected)
}

#[pymethods]
impl Store {
    #[new]
    #[pyo3(signature = (width, height, dimensions, *, reservoir=0, seed=0))]
    fn new(
        py: Python,
        #[pyo3(from_py_with = arguments::whole)] width: usize,
        #[pyo3(from_py_with = arguments::whole)] height: usize,
        #[pyo3(from_py_with = arguments::names)] dimensions: Vec<String>,
        #[pyo3(from_py_with = arguments::whole)] reservoir: usize,
        #[pyo3(from_py_with = arguments::whole)] seed: u64,
    ) -> PyResult<Self> {
        let columns = Columns::new(&dimensions).map_err(value_error)?;
        Self::empty(py, width, height, columns, reservoir, seed)
    }

    /// Creates a store from the moments of two independent halves of the samples.
    #[staticmethod]
    #[pyo3(signature = (dimensions, counts, means, variances, *, seed=0))]
    fn from_moments(
        py: Python,
        #[pyo3(from_py_with = arguments::names)] dimensions: Vec<String>,
        counts: &Bound<PyAny>,
        means: &Bound<PyAny>,
        variances: &Bound<PyAny>,
        #[pyo3(from_py_with = arguments::whole)] seed: u64,
    ) -> PyResult<Self> {
        // Take the buffers
        let columns = Columns::new(&dimensions).map_err(value_error)?;
        let count = columns.count();
        let accepted = format!("an array of real numbers of shape (2, height, width, {count})");
        let means = arrays::reals("means", means, &[4], &accepted)?;
        let &[halves, height, width, found] = means.shape() else { unreachable!("four axes") };
        if (halves, found) != (2, count) {
            return Err(arrays::wrong_shape("means", means.shape(), &accepted));
        }
        check_size(&columns, [width, height], 0)?;
        let accepted = format!("an array of real numbers of shape (2, {height}, {width}, {count})");
        let variances = arrays::reals("variances", variances, &[4], &accepted)?;
        if variances.shape() != means.shape() {
            return Err(arrays::wrong_shape("variances", variances.shape(), &accepted));
        }
        let accepted = format!("an array of integers from 0 up of shape (2, {height}, {width})");
        let counts = arrays::integers("counts", counts, &[3], &accepted)?;
        if counts.shape() != [2, height, width] {
            return Err(arrays::wrong_shape("counts", counts.shape(), &accepted));
        }

        // Divide them into halves
        let counts = arrays::borrow("counts", &counts)?;
        let (means, variances) = (arrays::borrow("means", &means)?, arrays::borrow("variances", &variances)?);
        let (counts, means, variances) = (counts.as_slice()?, means.as_slice()?, variances.as_slice()?);
        let (pixels, values) = (width * height, width * height * count);
        let halves = [0, 1].map(|half| HalfMoments {
            counts: &counts[half * pixels..][..pixels],
            means: &means[half * values..][..values],
            variances: &variances[half * values..][..values],
        });
        let store = py
            .detach(|| stats::Store::from_half_moments(width, height, &columns, &halves, seed))
            .map_err(value_error)?;
        Ok(Self::from_parts(Arc::new(store), columns, seed))
    }

    /// Reads the store of a render state.
    #[staticmethod]
    fn load(py: Python, path: PathBuf) -> PyResult<Self> {
        py.detach(|| RenderState::read(&path)).map(Self::from_state).map_err(state_error)
    }

    #[getter]
    fn width(&self, py: Python) -> usize {
        self.statistics(py).width()
    }

    #[getter]
    fn height(&self, py: Python) -> usize {
        self.statistics(py).height()
    }

    /// Names of the dimensions, in the order of the last axis of statistics.
    #[getter]
    fn dimensions(&self, py: Python) -> Vec<&'static str> {
        self.statistics(py).layout().names().collect()
    }

    /// Sample vectors that are kept of each pixel at most.
    #[getter]
    fn reservoir(&self, py: Python) -> usize {
        self.statistics(py).capacity()
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.seed
    }

    /// Valid samples of the whole image.
    #[getter]
    fn samples(&self, py: Python) -> u64 {
        let store = self.statistics(py);
        py.detach(|| store.samples())
    }

    /// Samples of the whole image that were rejected.
    #[getter]
    fn rejected(&self, py: Python) -> u64 {
        let store = self.statistics(py);
        py.detach(|| store.rejected())
    }

    /// Valid samples per pixel, on average.
    #[getter]
    fn spp(&self, py: Python) -> f64 {
        let store = self.statistics(py);
        py.detach(|| store.samples()) as f64 / store.pixels() as f64
    }

    /// Adds the samples of a rectangle of pixels with its upper left corner at (x, y).
    #[pyo3(signature = (samples, *, x=0, y=0))]
    fn push(
        &self,
        py: Python,
        samples: &Bound<PyAny>,
        #[pyo3(from_py_with = arguments::whole)] x: usize,
        #[pyo3(from_py_with = arguments::whole)] y: usize,
    ) -> PyResult<()> {
        let columns = self.columns.count();
        let accepted = format!(
            "an array of real numbers of shape (height, width, samples, {columns}) or (height, width, {columns})"
        );
        let array = arrays::reals("samples", samples, &[3, 4], &accepted)?;
        let (size, samples, found) = match *array.shape() {
            [height, width, found] => ([width, height], 1, found),
            [height, width, samples, found] => ([width, height], samples, found),
            _ => unreachable!("three or four axes"),
        };
        if found != columns {
            return Err(arrays::wrong_shape("samples", array.shape(), &accepted));
        }
        let values = arrays::borrow("samples", &array)?;
        let rectangle = SampleRectangle { corner: [x, y], size, samples, values: values.as_slice()? };
        self.add(py, |store| store.push_rectangle(&self.columns, &rectangle)).map_err(value_error)
    }

    /// Adds samples of pixels in any order: one row of `pixels`, (x, y), and one of `samples` for each.
    fn push_pixels(&self, py: Python, pixels: &Bound<PyAny>, samples: &Bound<PyAny>) -> PyResult<()> {
        let columns = self.columns.count();
        let accepted = "an array of integers from 0 up of shape (samples, 2), an x and a y a row";
        let pixels = arrays::integers("pixels", pixels, &[2], accepted)?;
        if pixels.shape()[1] != 2 {
            return Err(arrays::wrong_shape("pixels", pixels.shape(), accepted));
        }
        let accepted = format!("an array of real numbers of shape ({}, {columns})", pixels.shape()[0]);
        let samples = arrays::reals("samples", samples, &[2], &accepted)?;
        if samples.shape() != [pixels.shape()[0], columns] {
            return Err(arrays::wrong_shape("samples", samples.shape(), &accepted));
        }
        let (pixels, samples) = (arrays::borrow("pixels", &pixels)?, arrays::borrow("samples", &samples)?);
        let (pixels, samples) = (pixels.as_slice()?, samples.as_slice()?);
        self.add(py, |store| store.push_pixels(&self.columns, pixels, samples)).map_err(value_error)
    }

    /// Valid samples of each pixel.
    #[pyo3(signature = (half=None))]
    fn counts(
        &self,
        py: Python,
        #[pyo3(from_py_with = arguments::whole_or_none)] half: Option<usize>,
    ) -> PyResult<Py<PyAny>> {
        let part = part(half)?;
        let store = self.statistics(py);
        let counts = py.detach(|| store.counts(part));
        arrays::map(py, counts, store.width())
    }

    /// Means of the samples.
    #[pyo3(signature = (names=None, *, half=None))]
    fn mean(
        &self,
        py: Python,
        names: Option<&Bound<PyAny>>,
        #[pyo3(from_py_with = arguments::whole_or_none)] half: Option<usize>,
    ) -> PyResult<Py<PyAny>> {
        self.read(py, names, half, |store, part, dimensions| store.means(part, dimensions))
    }

    /// Unbiased variances of the samples.
    #[pyo3(signature = (names=None, *, half=None))]
    fn variance(
        &self,
        py: Python,
        names: Option<&Bound<PyAny>>,
        #[pyo3(from_py_with = arguments::whole_or_none)] half: Option<usize>,
    ) -> PyResult<Py<PyAny>> {
        self.read(py, names, half, |store, part, dimensions| store.variances(part, dimensions))
    }

    /// Standard deviations of the samples.
    #[pyo3(signature = (names=None, *, half=None))]
    fn deviation(
        &self,
        py: Python,
        names: Option<&Bound<PyAny>>,
        #[pyo3(from_py_with = arguments::whole_or_none)] half: Option<usize>,
    ) -> PyResult<Py<PyAny>> {
        self.read(py, names, half, |store, part, dimensions| {
            let mut planes = store.variances(part, dimensions);
            planes.data_mut().iter_mut().for_each(|value| *value = value.sqrt());
            planes
        })
    }

    fn __repr__(&self, py: Python) -> String {
        format!("<prpf.Store {}x{} pixels, {:.1} spp>", self.width(py), self.height(py), self.spp(py))
    }
}
