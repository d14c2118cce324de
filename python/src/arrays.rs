//! Converts between numpy arrays and the library's planes.
//!
//! Results become arrays without a copy: an image is a view of its planes with the axes (row, column, channel). Arguments
//! are copied only if they are not yet contiguous arrays of the right type.

use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use prpf::image::Planes;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::errors::value_error;

/// Returns planes as an array of shape (height, width, planes).
pub fn image(py: Python, planes: Planes) -> PyResult<Py<PyAny>> {
    let shape = [planes.count(), planes.height(), planes.width()];
    let array = PyArray1::from_vec(py, planes.into_data()).reshape(shape)?;
    Ok(array.call_method1("transpose", (1, 2, 0))?.unbind())
}

/// Returns one value per pixel as an array of shape (height, width).
pub fn map<T: Element>(py: Python, values: Vec<T>, width: usize) -> PyResult<Py<PyAny>> {
    let height = values.len() / width.max(1);
    Ok(PyArray1::from_vec(py, values).reshape([height, width])?.into_any().unbind())
}

/// Takes an argument as a contiguous array of `f32` with this number of axes.
pub fn reals<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    axes: &[usize],
    accepted: &str,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let array = typed(name, value, "fiub", "float32", accepted)?;
    check_axes(name, &array, axes, accepted)?;
    Ok(array.cast_into::<PyArrayDyn<f32>>()?)
}

/// Takes an argument as an integer in the range of `u32` for each pixel; one number stands for all.
pub fn counts(name: &str, value: &Bound<PyAny>, [height, width]: [usize; 2]) -> PyResult<Vec<u32>> {
    let accepted =
        format!("a number from 0 to {}, or an array of them of shape ({height}, {width})", u32::MAX);
    let array = integers(name, value, &[0, 2], &accepted)?;
    let values = copy(name, &array)?;
    match array.shape() {
        [] => Ok(vec![values[0]; width * height]),
        found if found == [height, width] => Ok(values),
        found => Err(wrong_shape(name, found, &accepted)),
    }
}

/// Takes an argument as a contiguous array of integers in the range of `u32`.
pub fn integers<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    axes: &[usize],
    accepted: &str,
) -> PyResult<Bound<'py, PyArrayDyn<u32>>> {
    // The range is checked before the conversion, which would wrap around
    let as_given = as_array(name, value, accepted)?;
    check_kind(name, &as_given, "iu", accepted)?;
    if as_given.getattr("size")?.extract::<usize>()? > 0 {
        for bound in ["min", "max"] {
            // As an integer of Python: those of NumPy 1 cannot be extracted
            let value: i128 = as_given.call_method0(bound)?.call_method0("item")?.extract()?;
            if u32::try_from(value).is_err() {
                return Err(value_error(format!("{name}: found {value}; accepted is {accepted}")));
            }
        }
    }
    let array = typed(name, &as_given, "iu", "uint32", accepted)?;
    check_axes(name, &array, axes, accepted)?;
    Ok(array.cast_into::<PyArrayDyn<u32>>()?)
}

/// Takes an argument as a real number for each pixel.
pub fn plane(name: &str, value: &Bound<PyAny>, [height, width]: [usize; 2]) -> PyResult<Vec<f32>> {
    let accepted = format!("an array of real numbers of shape ({height}, {width})");
    let array = reals(name, value, &[2], &accepted)?;
    match array.shape() {
        found if found == [height, width] => copy(name, &array),
        found => Err(wrong_shape(name, found, &accepted)),
    }
}

/// Takes an argument of shape (height, width, 3) as planes.
pub fn rgb(name: &str, value: &Bound<PyAny>) -> PyResult<Planes> {
    planes(name, value, None, 3)
}

/// Takes an argument of shape (height, width, planes) as planes; `size` is the width and height that it must have.
pub fn planes(name: &str, value: &Bound<PyAny>, size: Option<[usize; 2]>, count: usize) -> PyResult<Planes> {
    let accepted = match size {
        Some([width, height]) => format!("an array of real numbers of shape ({height}, {width}, {count})"),
        None => format!("an array of real numbers of shape (height, width, {count})"),
    };
    let array = reals(name, value, &[3], &accepted)?;
    let &[height, width, found] = array.shape() else { unreachable!("three axes") };
    if found != count || height * width == 0 || size.is_some_and(|size| size != [width, height]) {
        return Err(wrong_shape(name, array.shape(), &accepted));
    }
    let values = borrow(name, &array)?;
    let values = values.as_slice()?;
    Ok(array.py().detach(|| {
        let mut planes = Planes::new(width, height, count);
        for (channel, plane) in planes.planes_mut().enumerate() {
            plane.iter_mut().zip(values[channel..].iter().step_by(count)).for_each(|(to, from)| *to = *from);
        }
        planes
    }))
}

/// Copies the values of an array. Meanwhile other threads run.
fn copy<T: Element + Copy>(name: &str, array: &Bound<PyArrayDyn<T>>) -> PyResult<Vec<T>> {
    let values = borrow(name, array)?;
    let values = values.as_slice()?;
    Ok(array.py().detach(|| values.to_vec()))
}

/// Borrows the values of an array.
///
/// # Errors
/// Another extension has borrowed them for writing.
pub fn borrow<'py, T: Element>(
    name: &str,
    array: &Bound<'py, PyArrayDyn<T>>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    array.try_readonly().map_err(|_| {
        value_error(format!(
            "{name}: found an array that another extension writes to; accepted is one that nothing writes to"
        ))
    })
}

/// Says that an array has another shape than it must.
pub fn wrong_shape(name: &str, found: &[usize], accepted: &str) -> PyErr {
    let axes: Vec<String> = found.iter().map(ToString::to_string).collect();
    let comma = if axes.len() == 1 { "," } else { "" };
    value_error(format!("{name}: found the shape ({}{comma}); accepted is {accepted}", axes.join(", ")))
}

fn check_axes(name: &str, array: &Bound<PyAny>, axes: &[usize], accepted: &str) -> PyResult<()> {
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if axes.contains(&shape.len()) { Ok(()) } else { Err(wrong_shape(name, &shape, accepted)) }
}

fn check_kind(name: &str, array: &Bound<PyAny>, kinds: &str, accepted: &str) -> PyResult<()> {
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    if kinds.contains(&kind) {
        return Ok(());
    }
    Err(PyTypeError::new_err(format!("{name}: found an array of {dtype}; accepted is {accepted}")))
}

/// Returns a contiguous, aligned array of a type, of a value of one of these kinds.
fn typed<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    kinds: &str,
    dtype: &str,
    accepted: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let array = as_array(name, value, accepted)?;
    check_kind(name, &array, kinds, accepted)?;
    numpy(value.py())?.call_method1("require", (array, dtype, ["C", "A"]))
}

/// Returns what numpy makes of a value.
fn as_array<'py>(name: &str, value: &Bound<'py, PyAny>, accepted: &str) -> PyResult<Bound<'py, PyAny>> {
    let array = numpy(value.py())?.call_method1("asarray", (value,));
    array.map_err(|error| match error.is_instance_of::<PyValueError>(value.py()) {
        true => value_error(format!("{name}: {}; accepted is {accepted}", error.value(value.py()))),
        false => error,
    })
}

fn numpy(py: Python) -> PyResult<Bound<PyModule>> {
    py.import("numpy")
}
