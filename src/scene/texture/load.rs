//! Reads image files for textures: EXR, HDR, PFM, PNG, JPEG, TGA and BMP.
//!
//! The size in the header is checked against the length of the file before anything is allocated, so
//! that a small file cannot request a large image.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use glam::Vec3;

use super::pfm;
use super::texture_image::TextureImage;
use crate::files::open_regular;
use crate::image::{exr_file, luminance};
use crate::memory::check_available;
use crate::scene::color_space::ColorSpace;

/// Largest number of texels of an image: 16 384 × 16 384.
const MAX_TEXELS: u64 = 1 << 28;
/// Largest number of texels per byte of a file: that of a blank PNG with one bit per texel.
const MAX_TEXELS_PER_BYTE: u64 = 8 * 1032;
/// Bytes of a channel of a texel while float texels are read: as stored, by plane and by texel.
const FLOAT_BYTES: u64 = 3 * size_of::<f32>() as u64;
/// Largest number of channels of an EXR file; renderers write far fewer.
const MAX_CHANNELS: usize = 64;
/// Values are clamped to this magnitude, so that sums of channels and texels stay finite.
const LARGEST: f32 = 1e30;
/// Replaces infinity: the largest half float, because most infinities overflowed one.
const LARGEST_HALF: f32 = 65504.0;

/// Encoding of stored values. Integer values are scaled to [0, 1] before they are decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    Srgb,
    Linear,
    /// Linear value = stored value to this power.
    Gamma(f32),
}

impl Encoding {
    /// The linear value of an encoded value.
    fn decode(self, value: f32) -> f32 {
        match self {
            Encoding::Linear => value,
            Encoding::Gamma(gamma) => value.max(0.0).powf(gamma),
            // IEC 61966-2-1.
            Encoding::Srgb if value <= 0.04045 => value / 12.92,
            Encoding::Srgb => ((value + 0.055) / 1.055).powf(2.4),
        }
    }

    /// Linear values of all bytes.
    fn byte_table(self) -> Box<[f32; 256]> {
        Box::new(std::array::from_fn(|byte| self.decode(byte as f32 / 255.0)))
    }
}

/// What an image is read as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// All channels. White is white whatever the colour space.
    Colour,
    /// All channels, of light: white is the illuminant of its colour space.
    Light,
    /// The luminance of the encoded values, without alpha.
    Luminance,
}

impl Content {
    /// Selects channels of float texels with `count` channels. Returns the new count and the values.
    fn select_floats(self, count: usize, data: Vec<f32>) -> (usize, Vec<f32>) {
        match self {
            Content::Luminance if count >= 3 => {
                let texels = data.chunks_exact(count);
                (1, texels.map(|texel| luminance([texel[0], texel[1], texel[2]])).collect())
            }
            _ => (count, data),
        }
    }

    fn select_integers(self, image: DynamicImage) -> DynamicImage {
        match self {
            Content::Colour | Content::Light => image,
            Content::Luminance if image.color().bytes_per_pixel() / image.color().channel_count() > 1 => {
                image.into_luma16().into()
            }
            Content::Luminance => image.into_luma8().into(),
        }
    }
}

/// Reads an image file; the extension determines the format. NaN becomes 0, and infinity the largest
/// half float.
///
/// # Errors
/// One sentence, without the file's name, if the file is missing, damaged, or of a kind or size
/// that is not accepted.
pub fn load(path: &Path, encoding: Encoding, content: Content) -> Result<TextureImage, String> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let format = match extension.as_str() {
        "exr" | "hdr" | "pfm" => None,
        "png" => Some(ImageFormat::Png),
        "jpg" | "jpeg" => Some(ImageFormat::Jpeg),
        "tga" => Some(ImageFormat::Tga),
        "bmp" => Some(ImageFormat::Bmp),
        _ => {
            let expected = "exr, hdr, pfm, png, jpg, tga or bmp";
            return Err(format!("unknown image format \"{extension}\"; expected {expected}"));
        }
    };
    let (file, length) = open_regular(path)?;
    let mut reader = BufReader::new(file);
    let make_image = |width, height, count, data: Vec<f32>| {
        let data = data.into_iter().map(finite).collect();
        let (count, mut data) = content.select_floats(count, data);
        decode(&mut data, count, encoding);
        without_opaque_alpha(width, height, count, data, 1.0, TextureImage::from_floats)
    };
    match format {
        None if extension == "pfm" => {
            let check = |width, height| check_size(width, height, length, 3 * FLOAT_BYTES);
            pfm::read(&mut reader, check, make_image)
        }
        None if extension == "hdr" => load_hdr(reader, length, make_image),
        None => load_exr(path, length, content, make_image),
        Some(format) => load_integers(reader, length, format, encoding, content),
    }
}

/// An image of one grey texel with an encoded value.
pub fn one_texel(value: f32, encoding: Encoding) -> TextureImage {
    TextureImage::from_floats(1, 1, 1, vec![encoding.decode(value)])
}

/// Decodes texels with `count` channels; alpha is already linear.
fn decode(data: &mut [f32], count: usize, encoding: Encoding) {
    if encoding != Encoding::Linear {
        for (_, value) in data.iter_mut().enumerate().filter(|(i, _)| i % count != 3) {
            *value = finite(encoding.decode(*value));
        }
    }
}

/// Checks a size from a header against the limits for a file of `length` bytes, and against the memory that is available
/// for `texel_bytes` of each texel.
fn check_size(width: u64, height: u64, length: u64, texel_bytes: u64) -> Result<(), String> {
    let plausible = length.saturating_mul(MAX_TEXELS_PER_BYTE).min(MAX_TEXELS);
    match width.checked_mul(height) {
        Some(texels @ 1..) if texels <= plausible => check_available(texels * texel_bytes)
            .map_err(|problem| format!("the header states {width}x{height} texels: {problem}")),
        _ => Err(format!(
            "the header states {width}x{height} texels; expected at most {plausible} in a file of {length} bytes"
        )),
    }
}

/// Reads R, G, B and A, or Y, or the only channel of an EXR file. Colours of pbrt's colour spaces are converted to linear sRGB; others
/// are taken for it.
fn load_exr(
    path: &Path,
    length: u64,
    content: Content,
    make: impl FnOnce(usize, usize, usize, Vec<f32>) -> TextureImage,
) -> Result<TextureImage, String> {
    let info = exr_file::read_info(path).map_err(|error| error.problem.to_string())?;
    if info.channels.len() > MAX_CHANNELS {
        return Err(format!(
            "the image has {} channels; expected at most {MAX_CHANNELS}",
            info.channels.len()
        ));
    }
    let count = info.channels.len().min(4) as u64;
    check_size(info.width as u64, info.height as u64, length, count * FLOAT_BYTES)?;
    let channel =
        |name: &str| info.channels.iter().find(|c| c.eq_ignore_ascii_case(name)).map(String::as_str);
    let names: Vec<&str> = match ["R", "G", "B"].map(channel) {
        [Some(r), Some(g), Some(b)] => [r, g, b].into_iter().chain(channel("A")).collect(),
        _ => channel("Y").into_iter().collect(),
    };
    // A single channel of any name is gray
    let names = match &info.channels[..] {
        [only] if names.is_empty() => vec![only.as_str()],
        _ => names,
    };
    if names.is_empty() {
        return Err("the image has none of the channels R, G, B and Y; expected R, G and B, or Y".into());
    }
    let planes = exr_file::read_channels(path, &names).map_err(|error| error.problem.to_string())?;
    let (width, height, count) = (planes.width(), planes.height(), names.len());
    let mut data = vec![0.0; width * height * count];
    for offset in 0..count {
        let texels = data.iter_mut().skip(offset).step_by(count);
        texels.zip(planes.plane(offset)).for_each(|(texel, &value)| *texel = value);
    }
    if let Some(space) = info.primaries.and_then(ColorSpace::from_primaries).filter(|_| count >= 3) {
        for texel in data.chunks_exact_mut(count) {
            let rgb = Vec3::from_slice(texel).as_dvec3();
            let rgb = if content == Content::Light { space.light_to_srgb(rgb) } else { space.to_srgb(rgb) };
            rgb.as_vec3().write_to_slice(texel);
        }
    }
    Ok(make(width, height, count, data))
}

/// Reads a Radiance HDR file.
fn load_hdr(
    reader: BufReader<File>,
    length: u64,
    make: impl FnOnce(usize, usize, usize, Vec<f32>) -> TextureImage,
) -> Result<TextureImage, String> {
    let decoder = HdrDecoder::new(reader).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into(), length, 3 * FLOAT_BYTES)?;
    let image = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
    Ok(make(width as usize, height as usize, 3, image.into_rgb32f().into_raw()))
}

/// Replaces NaN and infinity and clamps to [`LARGEST`].
fn finite(value: f32) -> f32 {
    match value {
        _ if value.is_nan() => 0.0,
        _ if value.is_infinite() => LARGEST_HALF.copysign(value),
        _ => value.clamp(-LARGEST, LARGEST),
    }
}

/// Returns whether a PNG file stores an alpha channel; a transparent colour, which becomes one when it is decoded, does not count.
fn stores_alpha(png: &mut BufReader<File>) -> bool {
    /// Place of the colour type in the file, and that of colours with alpha (PNG specification, section 11.2.1).
    const COLOUR_TYPE: usize = 25;
    const RGBA: u8 = 6;
    let mut start = [0; COLOUR_TYPE + 1];
    let is_read = png.read_exact(&mut start).is_ok();
    png.rewind().is_ok() && is_read && start[COLOUR_TYPE] == RGBA
}

/// Reads a PNG, JPEG, TGA or BMP file.
fn load_integers(
    mut reader: BufReader<File>,
    length: u64,
    format: ImageFormat,
    encoding: Encoding,
    content: Content,
) -> Result<TextureImage, String> {
    // As in pbrt-v4, alpha is used in PNG files only
    let has_alpha = format == ImageFormat::Png && stores_alpha(&mut reader);

    // Decode the file
    let mut reader = ImageReader::with_format(reader, format);
    let mut limits = Limits::default();
    // Allow four channels of 16 bits
    limits.max_alloc = Some(MAX_TEXELS * 8);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    let colour = decoder.color_type();
    let stored = u64::from(colour.channel_count());
    // A copy is made of bytes, and floats of 16-bit values.
    let is_byte = u64::from(colour.bytes_per_pixel()) == stored;
    check_size(width.into(), height.into(), length, stored * if is_byte { 2 } else { FLOAT_BYTES })?;
    let image = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
    let image = content.select_integers(image);

    // Convert texels of 8 and 16 bits
    let (width, height) = (width as usize, height as usize);
    let bytes = |channels, data: Vec<u8>| {
        without_opaque_alpha(width, height, channels, data, u8::MAX, |w, h, c, data| {
            TextureImage::from_bytes(w, h, c, data, encoding.byte_table())
        })
    };
    let words = |channels: usize, data: Vec<u16>| {
        let scale = 1.0 / f32::from(u16::MAX);
        let mut data: Vec<f32> = data.iter().map(|&word| f32::from(word) * scale).collect();
        decode(&mut data, channels, encoding);
        without_opaque_alpha(width, height, channels, data, 1.0, TextureImage::from_floats)
    };

    // Choose the number of channels
    Ok(match image {
        DynamicImage::ImageLuma8(image) => bytes(1, image.into_raw()),
        DynamicImage::ImageLumaA8(_) => bytes(1, image.into_luma8().into_raw()),
        DynamicImage::ImageRgba8(image) if has_alpha => bytes(4, image.into_raw()),
        DynamicImage::ImageLuma16(image) => words(1, image.into_raw()),
        DynamicImage::ImageLumaA16(_) => words(1, image.into_luma16().into_raw()),
        DynamicImage::ImageRgb16(image) => words(3, image.into_raw()),
        DynamicImage::ImageRgba16(image) if has_alpha => words(4, image.into_raw()),
        DynamicImage::ImageRgba16(_) => words(3, image.into_rgb16().into_raw()),
        other => bytes(3, other.into_rgb8().into_raw()),
    })
}

/// Makes an image, without its alpha channel if it is opaque everywhere.
fn without_opaque_alpha<T: Copy + PartialEq>(
    width: usize,
    height: usize,
    channels: usize,
    data: Vec<T>,
    opaque: T,
    make: impl Fn(usize, usize, usize, Vec<T>) -> TextureImage,
) -> TextureImage {
    if channels == 4 && data.chunks_exact(4).all(|texel| texel[3] == opaque) {
        let rgb = data.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
        make(width, height, 3, rgb)
    } else {
        make(width, height, channels, data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn saved(name: &str, image: &DynamicImage) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        image.save(&path).unwrap();
        (folder, path)
    }

    fn gray(value: u8) -> DynamicImage {
        DynamicImage::ImageLuma8(::image::GrayImage::from_pixel(4, 2, ::image::Luma([value])))
    }

    #[test]
    fn a_png_is_decoded_by_its_encoding() {
        let (_folder, path) = saved("a.png", &gray(128));
        let value = |encoding| load(&path, encoding, Content::Colour).unwrap().float(3, 1);
        assert!((value(Encoding::Srgb) - 0.215_86).abs() < 1e-4);
        assert!((value(Encoding::Linear) - 128.0 / 255.0).abs() < 1e-6);
        assert!((value(Encoding::Gamma(2.0)) - (128.0f32 / 255.0).powi(2)).abs() < 1e-6);
    }

    #[test]
    fn opaque_alpha_is_dropped_and_other_alpha_is_kept() {
        let mut image = ::image::RgbaImage::from_pixel(2, 1, ::image::Rgba([0, 0, 0, 255]));
        let (_folder, path) = saved("a.png", &DynamicImage::ImageRgba8(image.clone()));
        assert_eq!(load(&path, Encoding::Srgb, Content::Colour).unwrap().float(0, 0), 0.0);
        image.put_pixel(1, 0, ::image::Rgba([0, 0, 0, 0]));
        let (_folder, path) = saved("b.png", &DynamicImage::ImageRgba8(image));
        assert_eq!(load(&path, Encoding::Srgb, Content::Colour).unwrap().float(0, 0), 1.0);
    }

    #[test]
    fn a_transparent_colour_is_no_alpha() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let chunk = |kind: &[u8], data: &[u8]| {
            let checksum = crc32fast::hash(&[kind, data].concat()).to_be_bytes();
            [&(data.len() as u32).to_be_bytes(), kind, data, &checksum].concat()
        };
        // Two texels of a palette: white, which is transparent, and black
        let texels = {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            std::io::Write::write_all(&mut encoder, &[0, 0, 1]).unwrap();
            encoder.finish().unwrap()
        };
        let file = [
            b"\x89PNG\r\n\x1a\n".to_vec(),
            chunk(b"IHDR", &[0, 0, 0, 2, 0, 0, 0, 1, 8, 3, 0, 0, 0]),
            chunk(b"PLTE", &[255, 255, 255, 0, 0, 0]),
            chunk(b"tRNS", &[0, 255]),
            chunk(b"IDAT", &texels),
            chunk(b"IEND", &[]),
        ];
        std::fs::write(&path, file.concat()).unwrap();
        let image = load(&path, Encoding::Linear, Content::Colour).unwrap();
        assert_eq!([image.float(0, 0), image.float(1, 0)], [1.0, 0.0]);
    }

    #[test]
    fn hdr_and_bmp_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        let texels = [[0.25, 4.0, 1.0], [0.0, 0.5, 8.0]].map(::image::Rgb);
        let encoder = ::image::codecs::hdr::HdrEncoder::new(File::create(&path).unwrap());
        encoder.encode(&texels, 2, 1).unwrap();
        let image = load(&path, Encoding::Linear, Content::Colour).unwrap();
        let close = |found: Vec3, wanted: [f32; 3]| (found - Vec3::from(wanted)).abs().max_element() < 0.04;
        assert!(close(image.rgb(0, 0), texels[0].0) && close(image.rgb(1, 0), texels[1].0));
        std::fs::write(&path, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 9 +X 9\n").unwrap();
        assert!(load(&path, Encoding::Linear, Content::Colour).is_err());
        let (_folder, path) = saved("a.bmp", &gray(51));
        assert!((load(&path, Encoding::Linear, Content::Colour).unwrap().float(3, 1) - 0.2).abs() < 1e-6);
    }

    #[test]
    fn sums_of_the_largest_values_stay_finite() {
        assert!((3.0 * finite(f32::MAX)).is_finite() && (3.0 * finite(f32::MIN)).is_finite());
        assert_eq!(finite(0.25), 0.25);
    }

    #[test]
    fn an_exr_keeps_finite_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let values = [(0.5, 2.0, -1.0), (f32::NAN, f32::INFINITY, 1e9)];
        exr::prelude::write_rgb_file(&path, 2, 1, |x, _| values[x]).unwrap();
        let image = load(&path, Encoding::Linear, Content::Colour).unwrap();
        assert_eq!(image.rgb(0, 0), Vec3::new(0.5, 2.0, -1.0));
        assert_eq!(image.rgb(1, 0), Vec3::new(0.0, 65504.0, 1e9));
    }

    #[test]
    fn an_exr_of_another_colour_space_is_converted() {
        use exr::prelude::*;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let channels = SpecificChannels::rgb(|_: Vec2<usize>| (0.42f32, 0.44f32, 0.92f32));
        let mut image = Image::from_channels((1, 1), channels);
        let at = |x, y| Vec2(x, y);
        image.attributes.chromaticities = Some(attribute::Chromaticities {
            red: at(0.7347, 0.2653),
            green: at(0.0, 1.0),
            blue: at(0.0001, -0.077),
            white: at(0.32168, 0.33767),
        });
        image.write().to_file(&path).unwrap();
        for (content, expected) in [
            (Content::Colour, Vec3::new(0.2035, 0.3994, 1.0012)),
            (Content::Light, Vec3::new(0.2215, 0.3983, 0.9220)),
        ] {
            let found = load(&path, super::Encoding::Linear, content).unwrap().rgb(0, 0);
            assert!((found - expected).abs().max_element() < 2e-3, "{content:?}: {found}");
        }
    }

    #[test]
    fn a_header_with_an_implausible_size_is_an_error() {
        let (_folder, path) = saved("a.tga", &gray(1));
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[12..16].fill(0xff); // width and height
        std::fs::write(&path, bytes).unwrap();
        assert!(load(&path, Encoding::Srgb, Content::Colour).unwrap_err().contains("65535x65535"));
    }

    #[test]
    fn damaged_and_missing_files_are_errors() {
        for name in ["a.png", "a.jpg", "a.tga", "a.bmp"] {
            let (_folder, path) = saved(name, &gray(77));
            let bytes = std::fs::read(&path).unwrap();
            std::fs::write(&path, &bytes[..bytes.len() / 3]).unwrap();
            assert!(load(&path, Encoding::Srgb, Content::Colour).is_err(), "{name}");
        }
        let (folder, path) = saved("a.png", &gray(1));
        assert!(load(&path.with_file_name("missing.exr"), Encoding::Srgb, Content::Colour).is_err());
        std::fs::create_dir(folder.path().join("b.png")).unwrap();
        let folder_error = load(&path.with_file_name("b.png"), Encoding::Srgb, Content::Colour);
        assert_eq!(folder_error.unwrap_err(), "it is a folder");
        assert!(
            load(Path::new("image.xyz"), Encoding::Srgb, Content::Colour)
                .unwrap_err()
                .contains("exr, hdr, pfm, png")
        );
    }

    #[test]
    fn luminance_is_computed_from_encoded_values() {
        let mut image = ::image::RgbaImage::from_pixel(1, 1, ::image::Rgba([0, 255, 0, 10]));
        let luminance = |path: &Path, encoding| load(path, encoding, Content::Luminance).unwrap().float(0, 0);
        let (_folder, path) = saved("a.png", &DynamicImage::ImageRgba8(image.clone()));
        assert!((luminance(&path, Encoding::Linear) - 0.7152).abs() < 0.003);
        assert!((luminance(&path, Encoding::Gamma(2.0)) - 0.5115).abs() < 0.004);
        image.put_pixel(0, 0, ::image::Rgba([255; 4]));
        let (folder, path) = saved("b.png", &DynamicImage::ImageRgba8(image).into_rgba16().into());
        assert_eq!(luminance(&path, Encoding::Srgb), 1.0);
        let path = folder.path().join("a.exr");
        exr::prelude::write_rgb_file(&path, 1, 1, |_, _| (0.0f32, 4.0f32, 0.0f32)).unwrap();
        assert!((luminance(&path, Encoding::Linear) - 2.8608).abs() < 1e-4);
        assert!((luminance(&path, Encoding::Gamma(2.0)) - 8.184).abs() < 1e-3);
    }

    #[test]
    fn float_files_are_decoded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        let texel = [3.0f32, -1.0, 1e30].map(f32::to_le_bytes);
        std::fs::write(&path, [&b"PF 1 1 -1 "[..9], b"\n", texel.as_flattened()].concat()).unwrap();
        let colour = load(&path, Encoding::Gamma(2.0), Content::Colour).unwrap().rgb(0, 0);
        assert_eq!(colour.truncate(), glam::Vec2::new(9.0, 0.0));
        assert!(colour.is_finite());
    }
}
