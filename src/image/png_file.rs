//! Writes 8-bit sRGB PNG files, and reads PNG, JPEG and TGA files.

use std::io::Write;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader, Limits};

use super::error::{MAX_SAMPLES, MAX_SIDE};
use super::tone::{srgb_decode, to_srgb8};
use super::{ImageError, Planes, Problem};
use crate::files::replace_file;
use crate::memory::check_available;

/// Length of the chunk `IEND` in bytes.
const END_LENGTH: usize = 12;

/// Writes the first three planes, or one plane as grey, as 8-bit sRGB PNG.
///
/// `exposure` is in stops; 0 leaves values unchanged. Values above 1 are clipped.
///
/// # Errors
/// [`Problem::Empty`] for an image without pixels, [`Problem::Unwritable`] for a size that PNG cannot
/// hold, [`Problem::Io`].
pub fn write(path: &Path, planes: &Planes, exposure: f32) -> Result<(), ImageError> {
    write_srgb8(path, planes.width(), planes.height(), &to_srgb8(planes, exposure))
}

/// Like [`write()`] without a change of exposure, and with texts: pairs of a keyword (1 to 79 characters) and a text, both
/// in ASCII.
///
/// # Errors
/// As [`write()`].
pub fn write_with_texts(path: &Path, planes: &Planes, texts: &[(&str, &str)]) -> Result<(), ImageError> {
    let with_texts = |png: Vec<u8>| {
        // The last chunk ends the file.
        let (image, end) = png.split_at(png.len() - END_LENGTH);
        [image, &texts.iter().flat_map(|(keyword, text)| text_chunk(keyword, text)).collect::<Vec<u8>>(), end]
            .concat()
    };
    encode(planes.width(), planes.height(), &to_srgb8(planes, 0.0))
        .and_then(|png| replace_file(path, |writer| Ok(writer.write_all(&with_texts(png))?)))
        .map_err(|problem: Problem| problem.at(path))
}

/// Returns the chunk of a text (PNG specification, section 11.3.3.2).
fn text_chunk(keyword: &str, text: &str) -> Vec<u8> {
    let content = [b"tEXt", keyword.as_bytes(), &[0], text.as_bytes()].concat();
    let mut checksum = flate2::Crc::new();
    checksum.update(&content);
    let length = (content.len() - 4) as u32;
    [&length.to_be_bytes(), &*content, &checksum.sum().to_be_bytes()].concat()
}

/// Writes interleaved 8-bit sRGB values unchanged: `3 × width × height` bytes.
///
/// # Errors
/// Those of [`encode`], and [`Problem::Io`].
pub fn write_srgb8(path: &Path, width: usize, height: usize, rgb: &[u8]) -> Result<(), ImageError> {
    encode(width, height, rgb)
        .and_then(|png| replace_file(path, |writer| Ok(writer.write_all(&png)?)))
        .map_err(|problem: Problem| problem.at(path))
}

/// Encodes interleaved 8-bit sRGB values as the bytes of a PNG file.
///
/// # Errors
/// [`Problem::Empty`] for an image without pixels; [`Problem::Unwritable`] if `rgb` does not have
/// `3 × width × height` bytes, or for a size that PNG cannot hold.
pub fn encode(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>, Problem> {
    if width == 0 || height == 0 {
        return Err(Problem::Empty);
    }
    if rgb.len() != 3 * width * height {
        return Err(Problem::Unwritable(format!("got {} bytes for {width}x{height} RGB pixels", rgb.len())));
    }
    let [Ok(width), Ok(height)] = [width, height].map(u32::try_from) else {
        return Err(Problem::Unwritable("width or height is too large for PNG".into()));
    };
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(rgb, width, height, ExtendedColorType::Rgb8)?;
    Ok(png)
}

/// Reads a PNG, JPEG or TGA file as three planes of linear light, decoding its values from sRGB.
///
/// Grey gives three equal planes; alpha is ignored.
///
/// # Errors
/// [`Problem::Unsupported`] for other formats, [`Problem::Malformed`] for a damaged or too large file,
/// [`Problem::Memory`], [`Problem::Io`].
pub fn read(path: &Path) -> Result<Planes, ImageError> {
    decode(path).map_err(|problem| problem.at(path))
}

fn decode(path: &Path) -> Result<Planes, Problem> {
    let mut limits = Limits::no_limits();
    limits.max_image_width = Some(MAX_SIDE as u32);
    limits.max_image_height = Some(MAX_SIDE as u32);
    limits.max_alloc = Some(MAX_SAMPLES as u64);
    let mut reader = ImageReader::open(path)?.with_guessed_format()?;
    // Without a known start the format is that of the file's name.
    if !matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Tga)) {
        return Err(Problem::Unsupported("the file is not an EXR, PNG, JPEG or TGA image".to_owned()));
    }
    reader.limits(limits);
    let decoder = reader.into_decoder()?;
    // As it is stored, as floats, and as planes.
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    check_available(decoder.total_bytes() + pixels * 6 * size_of::<f32>() as u64).map_err(Problem::Memory)?;
    let image = DynamicImage::from_decoder(decoder)?.into_rgb32f();

    let (width, height) = (image.width() as usize, image.height() as usize);
    let mut planes = Planes::new(width, height, 3);
    for (channel, plane) in planes.planes_mut().enumerate() {
        for (value, pixel) in plane.iter_mut().zip(image.as_raw().chunks_exact(3)) {
            *value = srgb_decode(pixel[channel]);
        }
    }
    Ok(planes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient(width: usize, height: usize) -> Planes {
        let mut planes = Planes::new(width, height, 3);
        let last = planes.data().len().max(2) - 1;
        for (i, value) in planes.data_mut().iter_mut().enumerate() {
            *value = srgb_decode((i * 255 / last) as f32 / 255.0);
        }
        planes
    }

    #[test]
    fn eight_bit_values_round_trip_exactly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        for (width, height) in [(1, 1), (1, 7), (16, 16)] {
            let planes = gradient(width, height);
            write(&path, &planes, 0.0).unwrap();
            assert_eq!(read(&path).unwrap(), planes);
        }
    }

    #[test]
    fn texts_stand_in_chunks_that_readers_skip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let planes = gradient(16, 16);
        write_with_texts(&path, &planes, &[("camera", "LookAt\nCamera")]).unwrap();
        assert_eq!(read(&path).unwrap(), planes);
        let bytes = std::fs::read(&path).unwrap();
        let chunk = b"\0\0\0\x14tEXtcamera\0LookAt\nCamera";
        assert!(bytes.windows(chunk.len()).any(|window| window == chunk));
        assert!(bytes.ends_with(b"IEND\xae\x42\x60\x82"));
    }

    #[test]
    fn one_plane_is_written_as_grey() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut map = Planes::new(2, 1, 1);
        map.data_mut().copy_from_slice(&[0.0, 5.0]);
        write(&path, &map, 0.0).unwrap();
        assert_eq!(read(&path).unwrap().data(), [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn an_image_without_pixels_is_refused_and_the_old_file_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write(&path, &gradient(2, 2), 0.0).unwrap();
        for (width, height) in [(0, 0), (0, 3), (3, 0)] {
            let error = write(&path, &Planes::new(width, height, 3), 0.0).unwrap_err();
            assert!(matches!(error.problem, Problem::Empty));
        }
        assert_eq!(read(&path).unwrap(), gradient(2, 2));
    }

    #[test]
    fn a_truncated_file_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let whole = encode(16, 16, &to_srgb8(&gradient(16, 16), 0.0)).unwrap();
        // The last chunk holds no pixels, so a file without it is still readable.
        for length in 0..whole.len() - 16 {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).is_err(), "the first {length} bytes were accepted as a whole file");
        }
    }

    #[test]
    fn a_flipped_bit_never_panics() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let whole = encode(5, 3, &to_srgb8(&gradient(5, 3), 0.0)).unwrap();
        let mut refused = 0;
        for bit in 0..8 * whole.len() {
            let mut damaged = whole.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, &damaged).unwrap();
            refused += usize::from(read(&path).is_err());
        }
        // PNG's checksums detect most flips.
        assert!(refused > 6 * whole.len(), "{refused} of {} flips were detected", 8 * whole.len());
    }

    #[test]
    fn a_header_with_a_too_large_size_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut png = encode(1, 1, &[0; 3]).unwrap();
        // IHDR: width at byte 16, height at 20, checksum of the 17 bytes from 12 at 29.
        png[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
        let mut checksum = flate2::Crc::new();
        checksum.update(&png[12..29]);
        png[29..33].copy_from_slice(&checksum.sum().to_be_bytes());
        std::fs::write(&path, &png).unwrap();
        assert!(read(&path).is_err());
    }
}
