//! The list of denoisers.

use std::ffi::{CString, c_char};
use std::ptr::null;
use std::sync::LazyLock;

use prpf::filter::DENOISERS;

static NAMES: LazyLock<Vec<CString>> = LazyLock::new(|| {
    let name = |text: String| CString::new(text).expect("names have no zero bytes");
    DENOISERS.iter().map(|denoiser| name(denoiser.name().to_string())).collect()
});

/// Returns the name of a denoiser, such as "nlm draft": the default's for index 0, NULL behind the last one. Names live as
/// long as the library.
#[unsafe(no_mangle)]
pub extern "C" fn prpf_denoiser_name(index: usize) -> *const c_char {
    NAMES.get(index).map_or(null(), |name| name.as_ptr())
}
