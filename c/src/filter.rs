//! Filter passes: a denoiser with its threads, its progress and its latest result.

use std::ffi::{c_char, c_int, c_void};
use std::ptr::null_mut;
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::time::Instant;

use prpf::filter::{CancellablePool, Cost, Denoiser, by_name, can_filter, draft_if_sparse};
use prpf::progressive::{FilterPass, Filtered};
use prpf::stats::Store;

use crate::arguments::{object, place, text};
use crate::status::{Failure, PrpfStatus, guard, invalid};
use crate::store::PrpfStore;
use crate::threads;

/// A denoiser, and the result of its latest pass. One thread uses a filter at a time.
pub struct PrpfFilter {
    content: Mutex<Content>,
}

/// A function that is called on the thread of prpf_filter_run() about 50 times a second during a pass.
///
/// user: as given to prpf_filter_set_progress().
///
/// fraction: of the pass, in [0, 1), estimated from the time of the filter's latest pass, or from an assumed time.
///
/// Returns 0 to go on, anything else to cancel the pass. It must not use the filter, throw an exception or jump out.
pub type PrpfProgress = Option<unsafe extern "C" fn(user: *mut c_void, fraction: f64) -> c_int>;

/// The state of a filter.
pub struct Content {
    denoiser: &'static dyn Denoiser,
    pool: CancellablePool,
    progress: PrpfProgress,
    user: *mut c_void,
    /// Seconds per unit of the latest pass; see [`units`].
    unit_seconds: f64,
    pub filtered: Option<Filtered>,
}

impl PrpfFilter {
    /// Takes the filter for this call.
    pub fn lock(&self) -> Result<MutexGuard<'_, Content>, Failure> {
        self.content.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => invalid(
                "filter: found one that another call uses; accepted is one call at a time, and none by its progress callback",
            ),
            TryLockError::Poisoned(_) => Failure {
                status: PrpfStatus::InternalError,
                message: "filter: found one that an earlier internal error has left unusable".to_owned(),
            },
        })
    }
}

impl Content {
    /// Returns the result of the latest pass.
    pub fn result(&self) -> Result<&Filtered, Failure> {
        self.filtered
            .as_ref()
            .ok_or_else(|| invalid("filter: found no result; accepted is a filter that has run"))
    }

    fn run(&mut self, store: &PrpfStore) -> Result<(), Failure> {
        let (store, seed) = {
            let content = store.lock()?;
            (content.store.clone(), content.seed)
        };
        self.filter(store, seed)
    }

    fn filter(&mut self, store: Arc<Store>, seed: u64) -> Result<(), Failure> {
        // Prepare the pass
        can_filter(self.denoiser, &store).map_err(invalid)?;
        let denoiser = draft_if_sparse(&store, self.denoiser);
        let units = units(&store, denoiser);
        let expected = units * self.unit_seconds;
        let pass = FilterPass { has_half_images: true, ..FilterPass::new(store, denoiser, seed) };

        // Run it
        let start = Instant::now();
        let (progress, user) = (self.progress, self.user);
        let should_cancel = || {
            // A pass that takes longer than expected is still not done.
            let fraction = (start.elapsed().as_secs_f64() / expected).min(0.99);
            // SAFETY: `prpf_filter_set_progress` asks for a function that may be called so.
            progress.is_some_and(|progress| unsafe { progress(user, fraction) } != 0)
        };
        let filtered = self.pool.run(|| pass.run(), should_cancel).ok_or_else(|| Failure {
            status: PrpfStatus::Cancelled,
            message: "the progress callback has cancelled the pass".to_owned(),
        })?;
        if let Some(message) = filtered.result.failure {
            return Err(Failure { status: PrpfStatus::DenoiserFailed, message });
        }
        self.unit_seconds = filtered.seconds / units;
        self.filtered = Some(filtered);
        Ok(())
    }
}

/// Returns the number of pixels or samples to which the time of a pass is proportional, at least 1.
fn units(store: &Store, denoiser: &dyn Denoiser) -> f64 {
    let units = if denoiser.cost().is_per_sample { store.samples() } else { store.pixels() as u64 };
    units.max(1) as f64
}

/// Creates a filter.
///
/// denoiser: a name that prpf_denoiser_name() gives, such as "nlm draft"; without its second word the method's default.
///
/// filter: becomes the filter, to be freed with prpf_filter_free(); NULL if there is none.
///
/// # Safety
/// Pointers are null or point to a text and to one value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_create(
    denoiser: *const c_char,
    filter: *mut *mut PrpfFilter,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (place, name) = unsafe { (place("filter", filter)?, text("denoiser", denoiser)) };
        place.write(null_mut());
        let denoiser = by_name(name?).map_err(invalid)?;
        let pool = CancellablePool::new(threads::limit()?).map_err(threads::cannot_start)?;
        let unit_seconds = denoiser.cost().core_seconds_with(Cost::MEMORY_SECONDS) / pool.threads() as f64;
        let content =
            Content { denoiser, pool, progress: None, user: null_mut(), unit_seconds, filtered: None };
        place.write(Box::into_raw(Box::new(PrpfFilter { content: Mutex::new(content) })));
        Ok(())
    })
}

/// Sets the function that is called during the passes of a filter and may cancel them; NULL for none. "oidn" is cancelled only
/// after its pass.
///
/// # Safety
/// `filter` is null or points to a filter; `progress` may be called with `user` during each of its passes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_set_progress(
    filter: *mut PrpfFilter,
    progress: PrpfProgress,
    user: *mut c_void,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let mut content = unsafe { object("filter", filter) }?.lock()?;
        (content.progress, content.user) = (progress, user);
        Ok(())
    })
}

/// Filters a store, and keeps the result until the filter's next completed pass. The calling thread waits. Others may add
/// samples to the store meanwhile; the pass does not see them, but the store is then copied.
///
/// A store with fewer samples than pixels may be filtered by a faster denoiser; see prpf_filter_made_by(). If the library of "oidn"
/// fails the status is PRPF_STATUS_DENOISER_FAILED.
///
/// # Safety
/// Pointers are null or point to a filter and a store.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_run(filter: *mut PrpfFilter, store: *const PrpfStore) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (filter, store) = unsafe { (object("filter", filter)?, object("store", store)?) };
        filter.lock()?.run(store)
    })
}

/// Frees a filter, which no other thread uses. NULL is ignored.
///
/// # Safety
/// `filter` is null or comes from prpf_filter_create() and has not been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_free(filter: *mut PrpfFilter) {
    if !filter.is_null() {
        // SAFETY: the caller's promise.
        drop(unsafe { Box::from_raw(filter) });
    }
}

#[cfg(test)]
mod tests {
    use prpf::filter::{DenoiserName, FilterResult, Reads, SampleVectors, nlm, unfiltered};
    use prpf::stats::{Block, Columns, SampleRectangle};

    use super::*;

    /// Gives the unfiltered image, as a denoiser does whose library fails.
    struct Failing;

    impl Denoiser for Failing {
        fn name(&self) -> DenoiserName {
            DenoiserName { method: "failing", preset: None }
        }

        fn summary(&self) -> &'static str {
            ""
        }

        fn reads(&self) -> Reads {
            Reads { blocks: &[Block::Colour], sample_vectors: SampleVectors::None }
        }

        fn cost(&self) -> Cost {
            nlm::DRAFT.cost()
        }

        fn stand_in(&self) -> &'static dyn Denoiser {
            &Failing
        }

        fn filter(&self, store: &Store, _: u64) -> FilterResult {
            FilterResult { failure: Some("there is no library".to_owned()), ..unfiltered(store) }
        }
    }

    #[test]
    fn a_denoiser_that_fails_leaves_the_latest_result() {
        let columns = Columns::new(&["R", "G", "B"]).unwrap();
        let mut store = Store::new(8, 8, columns.layout().clone(), 0, 0);
        let values = [0.5; 8 * 8 * 4 * 3];
        let rectangle = SampleRectangle { corner: [0, 0], size: [8, 8], samples: 4, values: &values };
        store.push_rectangle(&columns, &rectangle).unwrap();
        let store = Arc::new(store);
        let mut content = Content {
            denoiser: &nlm::DRAFT,
            pool: CancellablePool::new(1).unwrap(),
            progress: None,
            user: null_mut(),
            unit_seconds: 1e-6,
            filtered: None,
        };
        content.filter(store.clone(), 0).unwrap();
        content.denoiser = &Failing;
        let failure = content.filter(store, 0).unwrap_err();
        assert_eq!(failure.status, PrpfStatus::DenoiserFailed);
        assert_eq!(failure.message, "there is no library");
        assert_eq!(content.result().unwrap().result.made_by, nlm::DRAFT.name());
    }
}
