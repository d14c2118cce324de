//! Writes named numpy arrays to one file: a zip archive of `.npy` files (numpy's format 1.0).
//!
//! The archive is not compressed, so that writing takes only as long as the disk takes.

use std::io::{self, Seek, SeekFrom, Write};

use zip::write::{SimpleFileOptions, ZipWriter};

/// A number that arrays can hold, little endian.
pub(super) trait Element: Copy {
    /// Type string of numpy.
    const KIND: &'static str;
    type Bytes: AsRef<[u8]>;
    fn bytes(self) -> Self::Bytes;
}

macro_rules! element {
    ($($kind:ty = $name:literal),*) => {$(
        impl Element for $kind {
            const KIND: &'static str = $name;
            type Bytes = [u8; size_of::<$kind>()];
            fn bytes(self) -> Self::Bytes {
                self.to_le_bytes()
            }
        }
    )*};
}
element!(u32 = "<u4", f32 = "<f4", f64 = "<f8");

/// An archive being written.
pub(super) struct Npz<W: Write + Seek>(ZipWriter<UntilError<W>>);

/// Returns the first error and pretends success afterwards: an archive that is dropped tries to finish itself and
/// would print that it cannot.
struct UntilError<W> {
    out: W,
    failed: bool,
}

/// A position beyond all that was written.
const BEYOND_END: u64 = 1 << 62;

impl<W> UntilError<W> {
    fn attempt<T>(&mut self, swallowed: T, act: impl FnOnce(&mut W) -> io::Result<T>) -> io::Result<T> {
        if self.failed {
            return Ok(swallowed);
        }
        act(&mut self.out).inspect_err(|_| self.failed = true)
    }
}

impl<W: Write> Write for UntilError<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.attempt(bytes.len(), |out| out.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.attempt((), W::flush)
    }
}

impl<W: Seek> Seek for UntilError<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let SeekFrom::Start(at) = to else { return self.attempt(BEYOND_END, |out| out.seek(to)) };
        self.attempt(at, |out| out.seek(to))
    }
}

impl<W: Write + Seek> Npz<W> {
    pub fn new(out: W) -> Self {
        Self(ZipWriter::new(UntilError { out, failed: false }))
    }

    /// Adds an array. `values` come in C order, as many as `shape` calls for.
    pub fn array<T: Element>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl IntoIterator<Item = T>,
    ) -> io::Result<()> {
        self.begin(name, &quoted(T::KIND), shape)?;
        let mut buffer = Vec::with_capacity(BUFFER);
        for value in values {
            buffer.extend_from_slice(value.bytes().as_ref());
            if buffer.len() >= BUFFER {
                self.0.write_all(&buffer)?;
                buffer.clear();
            }
        }
        self.0.write_all(&buffer)
    }

    /// Adds an array of texts; an empty `shape` makes it a scalar.
    pub fn texts(&mut self, name: &str, shape: &[usize], texts: &[&str]) -> io::Result<()> {
        let longest = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        self.begin(name, &quoted(&format!("<U{longest}")), shape)?;
        for text in texts {
            let padded = text.chars().map(u32::from).chain(std::iter::repeat(0)).take(longest);
            let bytes: Vec<u8> = padded.flat_map(u32::to_le_bytes).collect();
            self.0.write_all(&bytes)?;
        }
        Ok(())
    }

    /// Adds an array of records with fields of these names and type strings, whose bytes are given.
    pub fn records(
        &mut self,
        name: &str,
        fields: &[(&str, &str)],
        count: usize,
        bytes: &[u8],
    ) -> io::Result<()> {
        let fields: String = fields.iter().map(|(name, kind)| format!("('{name}', '{kind}'), ")).collect();
        self.begin(name, &format!("[{fields}]"), &[count])?;
        self.0.write_all(bytes)
    }

    pub fn finish(self) -> io::Result<()> {
        self.0.finish()?.flush()
    }

    /// `kind` is a type in numpy's notation: a quoted type string, or a list of fields.
    fn begin(&mut self, name: &str, kind: &str, shape: &[usize]) -> io::Result<()> {
        let options =
            SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored).large_file(true);
        self.0.start_file(format!("{name}.npy"), options)?;
        self.0.write_all(&header(kind, shape))
    }
}

/// Size of the write buffer, in bytes.
const BUFFER: usize = 1 << 20;

fn quoted(kind: &str) -> String {
    format!("'{kind}'")
}

/// Returns the head of an `.npy` file: magic, version, and a Python dictionary, padded so that the values are aligned.
fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    const ALIGNMENT: usize = 64;
    const PREAMBLE: usize = 10;
    let shape: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut text = format!("{{'descr': {kind}, 'fortran_order': False, 'shape': ({shape}), }}");
    let length = (PREAMBLE + text.len() + 1).next_multiple_of(ALIGNMENT) - PREAMBLE;
    text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend_from_slice(&(length as u16).to_le_bytes());
    header.extend_from_slice(text.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk, and the bytes that it has room for.
    struct Small(io::Cursor<Vec<u8>>, usize);

    impl Write for Small {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0.get_ref().len() + bytes.len() > self.1 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.0.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Small {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.seek(to)
        }
    }

    #[test]
    fn whatever_a_full_disk_cuts_off_is_an_error_and_the_rest_is_not_tried() {
        let write = |most: usize| {
            let mut npz = Npz::new(Small(io::Cursor::default(), most));
            npz.array("a", &[1000], (0..1000).map(f64::from))?;
            npz.texts("b", &[1], &["text"])?;
            npz.finish()
        };
        for most in (0..8500).step_by(50) {
            assert_eq!(write(most).map_err(|error| error.kind()), Err(io::ErrorKind::StorageFull), "{most}");
        }
        write(10_000).unwrap();
    }

    #[test]
    fn a_header_is_a_padded_python_dictionary() {
        let header = header("'<f4'", &[3, 2]);
        assert_eq!(header.len() % 64, 0);
        assert_eq!(&header[..10], b"\x93NUMPY\x01\x00\x76\x00");
        let text = std::str::from_utf8(&header[10..]).unwrap();
        assert!(text.starts_with("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2, ), }"), "{text}");
        assert!(text.ends_with(" \n"));
    }
}
