//! Prefetching of memory that is about to be read.

/// Loads `items[index]` into the first-level cache; does nothing where the processor has no such hint.
#[inline(always)]
pub fn prefetch<T>(items: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        /// Bytes.
        const CACHE_LINE: usize = 64;
        let item = items.as_ptr().wrapping_add(index).cast::<i8>();
        for offset in (0..size_of::<T>()).step_by(CACHE_LINE) {
            // SAFETY: a hint that every such processor takes, and that no address makes fail.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(item.wrapping_add(offset)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, index);
}
