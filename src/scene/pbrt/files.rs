//! Opens the files of a scene. Files whose name ends in `.gz` are decompressed.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use crate::files::open_regular;
use crate::memory::{available_bytes, format_bytes};

/// Largest expansion of a gzip file (the limit of DEFLATE).
const MAX_INFLATION: u64 = 1032;

/// An open file, decompressed.
pub struct Source {
    pub reader: Box<dyn BufRead>,
    /// Upper bound on the bytes that `reader` yields.
    pub max_length: u64,
}

/// Opens a file for reading.
///
/// # Errors
/// As [`open_regular`].
pub fn open(path: &Path) -> Result<Source, String> {
    let (file, length) = open_regular(path)?;
    let plain = BufReader::new(file);
    Ok(if path.extension().is_some_and(|extension| extension == "gz") {
        let reader = Box::new(BufReader::new(MultiGzDecoder::new(plain)));
        Source { reader, max_length: length.saturating_mul(MAX_INFLATION) }
    } else {
        Source { reader: Box::new(plain), max_length: length }
    })
}

/// Reads a whole file.
///
/// # Errors
/// As [`open`]; too little memory for what the file holds or unpacks to.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    /// Memory per byte of a file: the growing buffer, its copy while it grows, and what is made of the text.
    const GROWTH: f64 = 4.0;
    let available = available_bytes().unwrap_or(f64::INFINITY);
    let most = (available / GROWTH) as u64;
    let mut bytes = Vec::new();
    let mut reader = open(path)?.reader.take(most.saturating_add(1));
    reader.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > most {
        return Err(format!(
            "it holds or unpacks to more than {}, too much for the {} of memory that are available",
            format_bytes(most as f64),
            format_bytes(available)
        ));
    }
    Ok(bytes)
}

/// Length (64 bits) and CRC-32 of a file as stored, little endian; `None` if it cannot be read.
pub fn checksum(path: &Path) -> Option<[u8; 12]> {
    let (file, length) = open_regular(path).ok()?;
    let mut reader = BufReader::with_capacity(1 << 18, file);
    let mut sum = crc32fast::Hasher::new();
    loop {
        let bytes = reader.fill_buf().ok()?;
        if bytes.is_empty() {
            break;
        }
        sum.update(bytes);
        let used = bytes.len();
        reader.consume(used);
    }
    let mut all = [0; 12];
    all[..8].copy_from_slice(&length.to_le_bytes());
    all[8..].copy_from_slice(&sum.finalize().to_le_bytes());
    Some(all)
}

/// Reads a text file of finite numbers; `#` starts a comment.
///
/// # Errors
/// One sentence, without the file's name.
pub fn numbers(path: &Path) -> Result<Vec<f64>, String> {
    let bytes = read(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let words = text.lines().enumerate().flat_map(|(line, text)| {
        text.split('#').next().unwrap_or("").split_whitespace().map(move |word| (line + 1, word))
    });
    words
        .map(|(line, word)| match word.parse() {
            Ok(number) if f64::is_finite(number) => Ok(number),
            _ => Err(format!("\"{word}\" in line {line} is not a finite number; expected a number")),
        })
        .collect()
}
