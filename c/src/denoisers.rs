//! The list of denoisers, and their weights.

use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr::null;
use std::sync::LazyLock;

use prpf::filter::{DENOISERS, learned};

use crate::arguments::text;
use crate::status::{PrpfStatus, guard, invalid};

static NAMES: LazyLock<Vec<CString>> = LazyLock::new(|| {
    let name = |text: String| CString::new(text).expect("names have no zero bytes");
    DENOISERS.iter().map(|denoiser| name(denoiser.name().to_string())).collect()
});

/// Returns the name of a denoiser, such as "nlm draft": the default's for index 0, NULL behind the last one. Names live as
/// long as the library. Those of "oidn" are in the list also where that is not installed: prpf_filter_create() then fails.
#[unsafe(no_mangle)]
pub extern "C" fn prpf_denoiser_name(index: usize) -> *const c_char {
    NAMES.get(index).map_or(null(), |name| name.as_ptr())
}

/// Filters by other weights of "learned", in the whole process: before the first pass, and once. The same file again changes
/// nothing.
///
/// path: of a file that training/export.py has written, in UTF-8.
///
/// # Safety
/// `path` is null or points to a text.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_use_weights(path: *const c_char) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let path = Path::new(unsafe { text("path", path) }?);
        learned::use_weights(path).map_err(|error| invalid(format!("{}: {error}", path.display())))
    })
}
