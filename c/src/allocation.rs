//! Allocation: from a result to priorities, and from priorities to the next sample counts.

use prpf::adaptive::{self, NO_CEILING, PrioritySettings, next_counts};

use crate::arguments::{array, object, output, write};
use crate::filter::PrpfFilter;
use crate::status::{PrpfStatus, guard, invalid};
use crate::store::PrpfStore;

/// Computes the priority of each pixel from the maps of a filter's result: [height][width]. Total sample counts should be
/// proportional to it.
///
/// store: the one that was filtered.
///
/// # Safety
/// Pointers are null or point to a filter, a store, and to as many values as their counts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_priority(
    filter: *const PrpfFilter,
    store: *const PrpfStore,
    priority: *mut f32,
    value_count: usize,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (filter, store) = unsafe { (object("filter", filter)?.lock()?, object("store", store)?) };
        let (result, store) = (&filter.result()?.result, store.lock()?.store.clone());
        let size = (store.width(), store.height());
        let accepted = (result.image.width(), result.image.height());
        if size != accepted {
            return Err(invalid(format!(
                "store: found {}x{} pixels; accepted is the size of the filter's result, {}x{}",
                size.0, size.1, accepted.0, accepted.1
            )));
        }
        // SAFETY: the caller's promise.
        let priority = unsafe { output("priority", priority, value_count, store.pixels()) }?;
        write(priority, &adaptive::priority(&store, result.into(), &PrioritySettings::default()));
        Ok(())
    })
}

/// Computes the sample counts of the next batch: [height][width].
///
/// priority: a number from 0 up for each pixel, to which total counts, with the samples that the store has, become proportional
/// as far as the batch allows; 15 % of it is distributed uniformly, and no pixel gets more than about 8 times its mean.
///
/// samples: of the batch.
///
/// min_spp, max_spp: bounds of a pixel's total; no upper bound for a max_spp of 0.
///
/// # Safety
/// Pointers are null or point to a store, and to as many values as their counts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_store_allocate(
    store: *const PrpfStore,
    priority: *const f32,
    priority_count: usize,
    samples: u64,
    min_spp: u32,
    max_spp: u32,
    counts: *mut u32,
    value_count: usize,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (store, priority) =
            unsafe { (object("store", store)?.lock()?, array("priority", priority, priority_count)?) };
        // SAFETY: the caller's promise.
        let counts = unsafe { output("counts", counts, value_count, store.store.pixels()) }?;
        let bounds = [min_spp, if max_spp == 0 { NO_CEILING } else { max_spp }];
        let next = next_counts(&store.store, priority, samples, bounds, store.seed).map_err(invalid)?;
        write(counts, &next);
        Ok(())
    })
}
