//! Pixel statistics: taking samples in.

use std::ffi::c_char;
use std::ptr::null_mut;
use std::sync::{Arc, Mutex, MutexGuard};

use prpf::progressive::{StoreSizeError, check_store_size};
use prpf::stats::{self, Columns, HalfMoments, Part, SampleRectangle};

use crate::arguments::{array, object, output, place, texts, write};
use crate::status::{Failure, PrpfStatus, guard, invalid};
use crate::threads;

/// Statistics of the samples of every pixel of an image. Several threads may use one store at a time; their calls wait for
/// each other.
pub struct PrpfStore {
    content: Mutex<Content>,
}

/// The samples of a store.
pub struct Content {
    /// Copied only if it changes while a filter pass still reads it.
    pub store: Arc<stats::Store>,
    pub seed: u64,
    /// The columns of the samples that are pushed.
    columns: Columns,
}

/// Half of the samples of every pixel, which a renderer has reduced to moments. Pixels are in rows from the top.
/// The buffers have as many values as these shapes say. All values are finite, also those of pixels without samples.
#[repr(C)]
pub struct PrpfHalfMoments {
    /// Number of samples, at most 1073741823: [height][width].
    pub counts: *const u32,
    /// Means of the samples, from -1e15 to 1e15, those of radiance from 0: [height][width][dimension].
    pub means: *const f32,
    /// Unbiased variances of the samples, not of their mean, from 0 to 1e30: [height][width][dimension].
    pub variances: *const f32,
}

impl PrpfStore {
    /// Hands a store over to C.
    fn new(store: stats::Store, columns: Columns, seed: u64) -> *mut Self {
        let content = Mutex::new(Content { store: Arc::new(store), seed, columns });
        Box::into_raw(Box::new(Self { content }))
    }

    /// Waits for other calls on the same store.
    pub fn lock(&self) -> Result<MutexGuard<'_, Content>, Failure> {
        self.content.lock().map_err(|_| Failure {
            status: PrpfStatus::InternalError,
            message: "store: found one that an earlier internal error has left unusable".to_owned(),
        })
    }
}

/// Checks the size of a store and the names of its columns.
fn columns(names: &[&str], width: usize, height: usize, reservoir: usize) -> Result<Columns, Failure> {
    let columns = Columns::new(names).map_err(invalid)?;
    match check_store_size(columns.layout(), (width, height), reservoir) {
        Ok(()) => Ok(columns),
        Err(error @ StoreSizeError::Size(..)) => Err(invalid(error)),
        Err(StoreSizeError::Memory(error)) => {
            Err(Failure { status: PrpfStatus::OutOfMemory, message: error.to_string() })
        }
    }
}

/// Creates an empty store for samples of any renderer.
///
/// width, height: of the image in pixels.
///
/// dimensions: the names of the values of a sample, in the order in which samples are pushed. "R", "G" and "B" are required
/// (linear radiance, not negative). Features improve the image: "albedo.r", "albedo.g", "albedo.b" in [0, 1]; unit normals
/// "N1.x", "N1.y", "N1.z" of the first hit and "N2.x", "N2.y", "N2.z" of the second; positions "P1.x", ... and "P2.x", ... in units of the
/// scene's diameter. Random parameters in [0, 1) are read by "prpf" and "rpf": "lens.u", "lens.v", "time", "light1.u", "light1.v",
/// "bsdf1.u", "bsdf1.v". "film.x" and "film.y" are the film position in pixels, the pixel's centre by default. "radiance.r", ...,
/// "emission.r", ... and "hit" are auxiliary. The names of a group are given together.
///
/// reservoir: sample vectors that are kept of each pixel: 0, or 8 for "prpf", or all for "rpf".
///
/// seed: of the reservoir and of filters.
///
/// store: becomes the store, to be freed with prpf_store_free(); NULL if there is none.
///
/// # Safety
/// Pointers are null or point to as many values as their counts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_create(
    width: usize,
    height: usize,
    dimensions: *const *const c_char,
    dimension_count: usize,
    reservoir: usize,
    seed: u64,
    store: *mut *mut PrpfStore,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (place, names) =
            unsafe { (place("store", store)?, texts("dimensions", dimensions, dimension_count)) };
        place.write(null_mut());
        let columns = columns(&names?, width, height, reservoir)?;
        threads::limit()?;
        let layout = columns.layout().clone();
        place.write(PrpfStore::new(stats::Store::new(width, height, layout, reservoir, seed), columns, seed));
        Ok(())
    })
}

/// Creates a store of buffers that a renderer has reduced its samples to.
///
/// halves: two independent halves of the samples of each pixel, such as two renders with different seeds. A half may have one
/// sample, of variance 0. There are no sample vectors, so that "prpf" and "rpf" cannot filter the store.
///
/// The other arguments are those of prpf_store_create().
///
/// # Safety
/// Pointers are null or point to as many values as their counts say, the buffers of the halves to as many as pixels, and
/// pixels times dimensions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_create_from_moments(
    width: usize,
    height: usize,
    dimensions: *const *const c_char,
    dimension_count: usize,
    halves: *const PrpfHalfMoments,
    seed: u64,
    store: *mut *mut PrpfStore,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (place, names) =
            unsafe { (place("store", store)?, texts("dimensions", dimensions, dimension_count)) };
        place.write(null_mut());
        let columns = columns(&names?, width, height, 0)?;
        let (pixels, values) = (width * height, width * height * columns.count());
        // SAFETY: the caller's promise; the size is checked.
        let [first, second] = unsafe { array("halves", halves, 2) }? else { unreachable!("two halves") };
        let moments = |half: &PrpfHalfMoments| -> Result<_, Failure> {
            // SAFETY: the caller's promise; the size is checked.
            unsafe {
                Ok(HalfMoments {
                    counts: array("counts", half.counts, pixels)?,
                    means: array("means", half.means, values)?,
                    variances: array("variances", half.variances, values)?,
                })
            }
        };
        let halves = [moments(first)?, moments(second)?];
        threads::limit()?;
        let made =
            stats::Store::from_half_moments(width, height, &columns, &halves, seed).map_err(invalid)?;
        place.write(PrpfStore::new(made, columns, seed));
        Ok(())
    })
}

/// Adds the samples of a rectangle of pixels, equally many of each. Samples must be independent, each with weight 1 in one pixel,
/// as from a box filter. One with a value that is not finite or beyond 1e15, or with negative radiance, is rejected alone.
///
/// x, y: the pixel of the rectangle's upper left corner. width, height: its size in pixels.
///
/// samples: samples of each pixel.
///
/// values: [height][width][samples][dimension]. value_count: their number.
///
/// # Safety
/// Pointers are null or point to a store, and to as many values as their counts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_push(
    store: *mut PrpfStore,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    samples: usize,
    values: *const f32,
    value_count: usize,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (store, values) = unsafe { (object("store", store)?, array("values", values, value_count)?) };
        let mut content = store.lock()?;
        let Content { store, columns, .. } = &mut *content;
        let rectangle = SampleRectangle { corner: [x, y], size: [width, height], samples, values };
        Arc::make_mut(store).push_rectangle(columns, &rectangle).map_err(invalid)
    })
}

/// Adds samples of pixels in any order. See prpf_store_push() for what is rejected.
///
/// pixels: an x and a y for each sample: [sample][2].
///
/// values: [sample][dimension].
///
/// # Safety
/// Pointers are null or point to a store, and to as many values as their counts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_push_pixels(
    store: *mut PrpfStore,
    pixels: *const u32,
    pixel_value_count: usize,
    values: *const f32,
    value_count: usize,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (store, pixels, values) = unsafe {
            (
                object("store", store)?,
                array("pixels", pixels, pixel_value_count)?,
                array("values", values, value_count)?,
            )
        };
        let mut content = store.lock()?;
        let Content { store, columns, .. } = &mut *content;
        Arc::make_mut(store).push_pixels(columns, pixels, values).map_err(invalid)
    })
}

/// Reads the number of valid samples of each pixel: [height][width].
///
/// # Safety
/// Pointers are null or point to a store, and to as many values as their counts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_counts(
    store: *const PrpfStore,
    counts: *mut u32,
    value_count: usize,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let content = unsafe { object("store", store) }?.lock()?;
        // SAFETY: the caller's promise.
        let counts = unsafe { output("counts", counts, value_count, content.store.pixels()) }?;
        write(counts, &content.store.counts(Part::Whole));
        Ok(())
    })
}

/// Reads the number of samples of the whole image. valid: those that are in the statistics. rejected: those that are not; see
/// prpf_store_push(). Either may be NULL.
///
/// # Safety
/// Pointers are null or point to a store, and to one value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_samples(
    store: *const PrpfStore,
    valid: *mut u64,
    rejected: *mut u64,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let content = unsafe { object("store", store) }?.lock()?;
        let store = &content.store;
        let wanted = [("valid", valid, store.samples()), ("rejected", rejected, store.rejected())]
            .into_iter()
            .filter(|(_, pointer, _)| !pointer.is_null());
        // Check both before one is written
        for (name, pointer, _) in wanted.clone() {
            // SAFETY: the caller's promise.
            unsafe { place(name, pointer) }?;
        }
        for (name, pointer, value) in wanted {
            // SAFETY: the caller's promise.
            unsafe { place(name, pointer) }?.write(value);
        }
        Ok(())
    })
}

/// Frees a store, which no other thread uses. NULL is ignored.
///
/// # Safety
/// `store` is null or comes from a function that creates stores and has not been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_free(store: *mut PrpfStore) {
    if !store.is_null() {
        // SAFETY: the caller's promise.
        drop(unsafe { Box::from_raw(store) });
    }
}
