//! Reads portable float maps (PFM): a text header, then rows of 32-bit floats from the bottom up.

use std::io::{BufRead, Read};

use super::texture_image::TextureImage;

/// Length limit of a word in the header.
const MAX_WORD: usize = 32;

/// Reads an image. `check` is called with the size before anything is allocated; `make` builds the
/// image from width, height, channels and values.
///
/// # Errors
/// One sentence.
pub(super) fn read(
    reader: &mut impl BufRead,
    check: impl Fn(u64, u64) -> Result<(), String>,
    make: impl FnOnce(usize, usize, usize, Vec<f32>) -> TextureImage,
) -> Result<TextureImage, String> {
    let channels = match word(reader)?.as_str() {
        "PF" => 3,
        "Pf" => 1,
        other => return Err(format!("the file begins with \"{other}\"; expected \"PF\" or \"Pf\"")),
    };
    let (width, height): (u32, u32) = (number(reader)?, number(reader)?);
    check(width.into(), height.into())?;
    let scale: f32 = number(reader)?;
    let (width, height) = (width as usize, height as usize);
    let row = width * channels;
    let mut data = vec![0.0; row * height];
    let mut bytes = vec![0; row * size_of::<f32>()];
    for y in (0..height).rev() {
        reader.read_exact(&mut bytes).map_err(|error| error.to_string())?;
        let (words, _) = bytes.as_chunks::<4>();
        for (value, &word) in data[y * row..(y + 1) * row].iter_mut().zip(words) {
            // The sign of the scale is the byte order
            let stored = if scale < 0.0 { f32::from_le_bytes(word) } else { f32::from_be_bytes(word) };
            *value = scale.abs() * stored;
        }
    }
    Ok(make(width, height, channels, data))
}

/// Reads the next word and one blank after it.
fn word(reader: &mut impl BufRead) -> Result<String, String> {
    let mut word = String::new();
    for byte in reader.by_ref().bytes() {
        let byte = byte.map_err(|error| error.to_string())?;
        match byte.is_ascii_whitespace() {
            true if word.is_empty() => {}
            true => return Ok(word),
            false if word.len() >= MAX_WORD => break,
            false => word.push(byte.into()),
        }
    }
    Err("the header has no end; expected magic word, width, height and scale".into())
}

/// Reads the next word as a number.
fn number<T: std::str::FromStr>(reader: &mut impl BufRead) -> Result<T, String> {
    let word = word(reader)?;
    word.parse().map_err(|_| format!("\"{word}\" in the header; expected a number"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_bytes(bytes: &[u8]) -> Result<TextureImage, String> {
        let small = |w, h| if w * h <= 100 { Ok(()) } else { Err("too large".into()) };
        read(&mut &bytes[..], small, TextureImage::from_floats)
    }

    fn file(header: &str, values: &[f32], bytes: fn(f32) -> [u8; 4]) -> Vec<u8> {
        header.bytes().chain(values.iter().flat_map(|&value| bytes(value))).collect()
    }

    #[test]
    fn both_byte_orders_are_read_from_the_bottom_up_and_scaled() {
        for bytes in [
            file("Pf\n1 2\n-1.0\n", &[3.0, 0.5], f32::to_le_bytes),
            file("Pf 1 2 0.5\n", &[6.0, 1.0], f32::to_be_bytes),
        ] {
            let image = read_bytes(&bytes).unwrap();
            assert_eq!((image.float(0, 0), image.float(0, 1)), (0.5, 3.0));
        }
        let colour = read_bytes(&file("PF\n1 1\n-1\n", &[1.0, 2.0, 3.0], f32::to_le_bytes)).unwrap();
        assert_eq!(colour.rgb(0, 0), glam::Vec3::new(1.0, 2.0, 3.0));
    }

    #[test]
    fn damaged_files_are_errors() {
        let good = file("Pf\n1 2\n-1.0\n", &[3.0, 0.5], f32::to_le_bytes);
        for length in 0..good.len() {
            assert!(read_bytes(&good[..length]).is_err(), "{length}");
        }
        for header in ["P6\n1 1\n1\n", "Pf\n-1 1\n1\n", "Pf\n99999 99999\n1\n"] {
            assert!(read_bytes(&file(header, &[0.0], f32::to_le_bytes)).is_err(), "{header}");
        }
    }
}
