//! The version of the library.

use std::ffi::{CStr, c_char};

/// Returns the version of the library, such as "0.1.0"; it lives as long as the library. A program that is compiled with
/// another PRPF_VERSION must be compiled anew: functions and structures may differ.
#[unsafe(no_mangle)]
pub extern "C" fn prpf_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    const TERMINATED: &CStr = match CStr::from_bytes_with_nul(VERSION.as_bytes()) {
        Ok(version) => version,
        Err(_) => panic!("versions have no zero bytes"),
    };
    TERMINATED.as_ptr()
}
