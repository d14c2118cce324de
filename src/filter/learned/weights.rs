//! The weights in use: those of this version, or others that a program gives before the first filter pass.

use std::io::Read;
use std::path::Path;
use std::sync::OnceLock;

use sha2::{Digest, Sha256};

use super::network::Network;
use super::weight_file::WeightFileError;
use crate::files::{error_message, open_regular};

/// No file of weights is nearly as long.
const MAX_FILE_BYTES: u64 = 64 << 20;

static WEIGHTS: OnceLock<Weights> = OnceLock::new();

/// The network, and what names its weights.
pub struct Weights {
    pub network: Network,
    /// The first sixteen digits of the file's SHA-256.
    id: String,
}

impl Weights {
    fn new(bytes: &[u8]) -> Result<Self, WeightFileError> {
        let digits = Sha256::digest(bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { network: Network::new(bytes)?, id: digits })
    }
}

/// Returns the weights in use.
pub fn weights() -> &'static Weights {
    WEIGHTS.get_or_init(|| {
        Weights::new(include_bytes!("weights.safetensors")).expect("the embedded weights are valid")
    })
}

/// Returns the name of the weights in use, for outputs: the first sixteen digits of their file's SHA-256.
pub fn weights_id() -> &'static str {
    &weights().id
}

/// Filters by the weights of a file that `training/export.py` wrote, in the whole process. They cannot be changed afterwards:
/// call it before the first pass. The same file again changes nothing.
///
/// # Errors
/// A file that cannot be read or is no file of weights for this version; other weights in use.
pub fn use_weights(path: &Path) -> Result<(), WeightFileError> {
    let (file, _) = open_regular(path).map_err(WeightFileError::Read)?;
    // A longer file is refused by its content: the rest of it is not read
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES)
        .read_to_end(&mut bytes)
        .map_err(|error| WeightFileError::Read(error_message(&error)))?;
    let given = Weights::new(&bytes)?;
    let id = given.id.clone();
    match WEIGHTS.get_or_init(|| given).id == id {
        true => Ok(()),
        false => Err(WeightFileError::InUse),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_embedded_weights_are_named_after_their_bytes() {
        assert!(weights_id().len() == 16 && weights_id().bytes().all(|digit| digit.is_ascii_hexdigit()));
        let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src/filter/learned/weights.safetensors"));
        assert_eq!(use_weights(file), Ok(()), "the same weights");
    }

    #[test]
    fn other_files_are_refused() {
        let embedded = include_bytes!("weights.safetensors");
        let mut not_finite = embedded.to_vec();
        let last = not_finite.len() - 2;
        not_finite[last..].copy_from_slice(&half::f16::INFINITY.to_le_bytes());
        let of_other_version = replaced(embedded, b"prpf learned 2", b"prpf learned 1");
        let none = use_weights(Path::new("none.safetensors")).unwrap_err();
        assert_eq!(none.to_string(), "no such file or folder");
        for (bytes, message) in [
            (&b"exr"[..], "not a file of weights"),
            (&embedded[..embedded.len() / 2], "not a file of weights"),
            (&not_finite, "found inf; accepted are"),
            (&of_other_version, "format: found `prpf learned 1`; accepted is `prpf learned 2`"),
        ] {
            let error = Weights::new(bytes).err().expect("refused").to_string();
            assert!(error.contains(message), "{error}");
        }
    }

    /// The bytes with the first occurrence of `from` replaced.
    fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
        let at = bytes.windows(from.len()).position(|part| part == from).expect("the format is there");
        [&bytes[..at], to, &bytes[at + from.len()..]].concat()
    }
}
