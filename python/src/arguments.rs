//! Converts arguments that are no arrays: whole numbers, names, functions.
//!
//! The messages say what was found and what is accepted; pyo3 adds the argument's name as a note.

use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::errors::value_error;

/// Takes a whole number that a `T` can hold, an unsigned type.
pub fn whole<T: TryFrom<u64>>(value: &Bound<PyAny>) -> PyResult<T> {
    let most = u64::MAX >> (u64::BITS - 8 * size_of::<T>() as u32);
    let message = || format!("found {}; accepted is a whole number from 0 to {most}", shown(value));
    match value.extract::<u64>() {
        Ok(number) => T::try_from(number).map_err(|_| value_error(message())),
        Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => Err(value_error(message())),
        Err(_) => Err(PyTypeError::new_err(message())),
    }
}

/// Takes a whole number or `None`.
pub fn whole_or_none<T: TryFrom<u64>>(value: &Bound<PyAny>) -> PyResult<Option<T>> {
    if value.is_none() { Ok(None) } else { whole(value).map(Some) }
}

/// Takes some whole numbers or `None`.
pub fn wholes_or_none<const N: usize>(value: &Bound<PyAny>) -> PyResult<Option<[usize; N]>> {
    if value.is_none() {
        return Ok(None);
    }
    let Ok(values) = value.extract::<[Bound<PyAny>; N]>() else {
        let found = shown(value);
        return Err(PyTypeError::new_err(format!("found {found}; accepted are {N} whole numbers from 0 up")));
    };
    let mut numbers = [0; N];
    for (number, value) in numbers.iter_mut().zip(values) {
        *number = whole(&value)?;
    }
    Ok(Some(numbers))
}

/// Takes a list of names.
pub fn names(value: &Bound<PyAny>) -> PyResult<Vec<String>> {
    let names = if value.is_instance_of::<PyString>() { None } else { value.extract().ok() };
    names.ok_or_else(|| PyTypeError::new_err(format!("found {}; accepted is a list of names", shown(value))))
}

/// Takes a function or `None`.
pub fn function_or_none(value: &Bound<PyAny>) -> PyResult<Option<Py<PyAny>>> {
    if value.is_none() {
        return Ok(None);
    }
    if !value.is_callable() {
        return Err(PyTypeError::new_err(format!("found {}; accepted is a function", shown(value))));
    }
    Ok(Some(value.clone().unbind()))
}

/// Returns a value as Python shows it, in short.
fn shown(value: &Bound<PyAny>) -> String {
    const MOST: usize = 60;
    let text =
        value.repr().map_or_else(|_| "a value that cannot be shown".to_owned(), |text| text.to_string());
    if text.chars().count() <= MOST { text } else { text.chars().take(MOST).chain("...".chars()).collect() }
}
