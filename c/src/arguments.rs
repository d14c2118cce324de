//! Checks pointers and turns them into references, slices and strings. Memory that a call writes to may be uninitialised.
//!
//! What can be told from a pointer is checked: that it is not null, is aligned, and that its length is one that memory can
//! have. That it points to so many values is the caller's promise, which every function of the header asks for.

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::slice::{from_raw_parts, from_raw_parts_mut};

use crate::status::{Failure, invalid};

/// Takes an object.
///
/// # Safety
/// `pointer` is null or points to a `T` that nothing changes without synchronisation while the reference lives.
pub unsafe fn object<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, Failure> {
    check(name, pointer)?;
    // SAFETY: neither null nor misaligned; the rest is promised.
    Ok(unsafe { &*pointer })
}

/// Takes a place for one value.
///
/// # Safety
/// `pointer` is null or points to memory of a `T` that nothing else uses while the reference lives.
pub unsafe fn place<'a, T>(name: &str, pointer: *mut T) -> Result<&'a mut MaybeUninit<T>, Failure> {
    check(name, pointer)?;
    // SAFETY: neither null nor misaligned; the rest is promised.
    Ok(unsafe { &mut *pointer.cast() })
}

/// Takes an array of `count` values; it may be null if there are none.
///
/// # Safety
/// `pointer` is null or points to `count` values that nothing changes while the slice lives.
pub unsafe fn array<'a, T>(name: &str, pointer: *const T, count: usize) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    check(name, pointer)?;
    check_count::<T>(name, count)?;
    // SAFETY: neither null nor misaligned nor too long; the rest is promised.
    Ok(unsafe { from_raw_parts(pointer, count) })
}

/// Takes an array of `count` values to write to, which must be `accepted`.
///
/// # Safety
/// `pointer` is null or points to memory of `count` values that nothing else uses while the slice lives.
pub unsafe fn output<'a, T>(
    name: &str,
    pointer: *mut T,
    count: usize,
    accepted: usize,
) -> Result<&'a mut [MaybeUninit<T>], Failure> {
    if count != accepted {
        return Err(invalid(format!(
            "{name}: found room for {count} values; accepted is room for {accepted}"
        )));
    }
    check(name, pointer)?;
    check_count::<T>(name, count)?;
    // SAFETY: neither null nor misaligned nor too long; the rest is promised.
    Ok(unsafe { from_raw_parts_mut(pointer.cast(), count) })
}

/// Writes a value to each place.
pub fn write<'a, T: Copy + 'a>(
    places: impl IntoIterator<Item = &'a mut MaybeUninit<T>>,
    values: impl IntoIterator<Item = &'a T>,
) {
    let mut values = values.into_iter();
    for place in places {
        place.write(*values.next().expect("a value for each place"));
    }
}

/// Takes a text in UTF-8.
///
/// # Safety
/// `pointer` is null or points to a text that ends with a zero byte and that nothing changes while the string lives.
pub unsafe fn text<'a>(name: &str, pointer: *const c_char) -> Result<&'a str, Failure> {
    check(name, pointer)?;
    // SAFETY: not null; the rest is promised.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| invalid(format!("{name}: found bytes that are not UTF-8; accepted is UTF-8")))
}

/// Takes an array of texts.
///
/// # Safety
/// As [`array`], and each of its pointers as [`text`].
pub unsafe fn texts<'a>(
    name: &str,
    pointer: *const *const c_char,
    count: usize,
) -> Result<Vec<&'a str>, Failure> {
    // SAFETY: as promised.
    let pointers = unsafe { array(name, pointer, count) }?;
    // SAFETY: as promised.
    pointers.iter().map(|&pointer| unsafe { text(name, pointer) }).collect()
}

fn check<T>(name: &str, pointer: *const T) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(invalid(format!("{name}: found a null pointer")));
    }
    if !pointer.is_aligned() {
        let alignment = align_of::<T>();
        return Err(invalid(format!(
            "{name}: found a pointer that is not aligned; accepted is a multiple of {alignment} bytes"
        )));
    }
    Ok(())
}

fn check_count<T>(name: &str, count: usize) -> Result<(), Failure> {
    let most = isize::MAX as usize / size_of::<T>();
    if count > most {
        return Err(invalid(format!("{name}: found {count} values; accepted are at most {most}")));
    }
    Ok(())
}
