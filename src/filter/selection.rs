//! Chooses a denoiser by its name, and tells whether it can filter a store: for programs that use the library.

use super::denoiser::Denoiser;
use super::denoisers::{DENOISERS, find};
use super::missing_data::MissingData;
use crate::stats::Store;

/// Why a denoiser cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SelectionError {
    #[error("denoiser: found `{found}`; accepted are {}", names())]
    Unknown { found: String },
    #[error("denoiser: found `{found}`; {reason}")]
    Missing { found: String, reason: &'static str },
    #[error("store: found no valid samples; accepted is at least one")]
    Empty,
    #[error("store: {0}")]
    MissingData(#[from] MissingData),
}

fn names() -> String {
    DENOISERS.map(|denoiser| denoiser.name().to_string()).join(", ")
}

/// Returns the denoiser of a name such as `nlm` or `nlm draft`.
///
/// # Errors
/// An unknown name; a denoiser that this machine lacks.
pub fn by_name(name: &str) -> Result<&'static dyn Denoiser, SelectionError> {
    let (method, preset) = match name.split_once(' ') {
        Some((method, preset)) => (method, Some(preset)),
        None => (name, None),
    };
    let found = || name.to_owned();
    let denoiser = find(method, preset).ok_or_else(|| SelectionError::Unknown { found: found() })?;
    match denoiser.missing() {
        Some(reason) => Err(SelectionError::Missing { found: found(), reason }),
        None => Ok(denoiser),
    }
}

/// Checks that a store has what a denoiser reads.
///
/// # Errors
/// A store without valid samples, or without data that the denoiser reads.
pub fn can_filter(denoiser: &dyn Denoiser, store: &Store) -> Result<(), SelectionError> {
    if store.samples() == 0 {
        return Err(SelectionError::Empty);
    }
    Ok(MissingData::check(store, denoiser)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Layout;

    #[test]
    fn names_with_and_without_presets_are_found() {
        assert_eq!(by_name("nlm").unwrap().name().to_string(), "nlm standard");
        assert_eq!(by_name("nlm draft").unwrap().name().to_string(), "nlm draft");
        for wrong in ["", "median", "nlm best", "nlm  draft", "nlm draft "] {
            let message = by_name(wrong).unwrap_err().to_string();
            assert!(
                message.contains(&format!("found `{wrong}`; accepted are learned standard, ")),
                "{message}"
            );
        }
    }

    #[test]
    fn a_store_needs_samples_and_the_sample_vectors_that_are_read() {
        let mut store = Store::new(1, 1, Layout::with_blocks(|_| false), 0, 0);
        let [nlm, prpf] = ["nlm", "prpf"].map(|name| by_name(name).unwrap());
        assert!(matches!(can_filter(nlm, &store), Err(SelectionError::Empty)));
        store.push(0, 0, &[0.5; 5]);
        can_filter(nlm, &store).unwrap();
        let message = can_filter(prpf, &store).unwrap_err().to_string();
        assert!(message.contains("found a reservoir of 0") && message.contains("prpf needs 8"), "{message}");
    }
}
