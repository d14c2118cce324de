//! Results of calls: a status, and a message for the thread that called.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr::null;

/// What became of a call. prpf_error_message() has details of every status but PRPF_STATUS_OK.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrpfStatus {
    /// Done.
    Ok = 0,
    /// An argument cannot be used. Nothing has changed.
    InvalidArgument = 1,
    /// There is too little memory, or the system starts no more threads. Nothing has changed.
    OutOfMemory = 2,
    /// A progress callback has cancelled the call.
    Cancelled = 3,
    /// The library is at fault. The objects of the call can only be freed.
    InternalError = 4,
    /// A library that the denoiser uses has failed. The filter keeps its latest result.
    DenoiserFailed = 5,
}

/// A status other than `Ok`, with its message.
#[derive(Debug)]
pub struct Failure {
    pub status: PrpfStatus,
    pub message: String,
}

thread_local! {
    static MESSAGE: RefCell<Option<CString>> = const { RefCell::new(None) };
}

/// An argument that cannot be used.
pub fn invalid(message: impl ToString) -> Failure {
    Failure { status: PrpfStatus::InvalidArgument, message: message.to_string() }
}

/// Runs the body of a function of the interface. Neither errors nor panics get past it.
pub fn guard(body: impl FnOnce() -> Result<(), Failure>) -> PrpfStatus {
    let (status, message) = match contained(body) {
        Ok(()) => (PrpfStatus::Ok, None),
        Err(Failure { status, message }) => {
            // Those of panics, and names that a caller gives, may have line breaks
            let message = message.replace(char::is_control, " ");
            (status, Some(CString::new(message).expect("zero bytes are gone")))
        }
    };
    // That of a thread that is ending is already gone
    let _ = MESSAGE.try_with(|latest| latest.replace(message));
    status
}

/// Runs the body of a function of the interface that returns no status, and leaves the message of the latest one that does.
pub fn contained<T>(body: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|payload| {
        let message = format!("the library is at fault: {}", panic_message(payload.as_ref()));
        Err(Failure { status: PrpfStatus::InternalError, message })
    })
}

fn panic_message(payload: &dyn Any) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

/// Returns what went wrong in the calling thread's last call that returns a status: one line of UTF-8 that says what was
/// found and what is accepted. NULL if nothing did. The text lives until that thread's next such call.
#[unsafe(no_mangle)]
pub extern "C" fn prpf_error_message() -> *const c_char {
    let latest = MESSAGE
        .try_with(|message| message.borrow().as_ref().map_or(null(), |message: &CString| message.as_ptr()));
    latest.unwrap_or(null())
}
