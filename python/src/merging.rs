//! Merging the states of renders that took other samples of one image.

use std::path::PathBuf;

use prpf::output::paths::{are_distinct, replaces_state};
use prpf::state::{Merge, RenderState};
use pyo3::prelude::*;

use crate::errors::{Error, state_error, value_error};
use crate::paths::can_be_written;
use crate::store::Store;

/// Adds the samples of some states and writes the sum.
#[pyfunction]
pub fn merge(py: Python, states: Vec<PathBuf>, output: PathBuf) -> PyResult<Store> {
    let Some((first, others)) = states.split_first().filter(|(_, others)| !others.is_empty()) else {
        return Err(value_error(format!("states: found {}; accepted are two or more", states.len())));
    };
    py.detach(|| {
        can_be_written(&output)?;
        replaces_state(&output).map_err(value_error)?;
        are_distinct(states.iter().map(PathBuf::as_path), &[&output]).map_err(value_error)?;
        let mut merge = Merge::new(RenderState::read(first).map_err(state_error)?);
        for path in others {
            let state = RenderState::read(path).map_err(state_error)?;
            merge.add(&state).map_err(|error| Error::new_err(format!("{}: {error}", path.display())))?;
        }
        let sum = merge.finish();
        sum.write(&output).map_err(state_error)?;
        Ok(Store::from_state(sum))
    })
}
