//! Writes OpenEXR files. Blocks are compressed in parallel and written in order.

use std::io::{Cursor, Write};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::lines::LineRefMut;
use exr::block::writer::ChunksWriter;
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, IntegerBounds, LineOrder, SampleType};
use exr::meta::header::{Header, LayerAttributes, standard_names};
use half::f16;
use rayon::prelude::*;

use super::attribute::{self, string, text};
use super::zip::Encoder;
use super::{Attribute, Channel, Metadata, Precision, Windows, side};
use crate::files::replace_file;
use crate::image::{ImageError, Problem};

/// Longest name of a channel in a file without [`LONG_NAMES`], in bytes.
const LONGEST_SHORT_NAME: usize = 31;
/// The flag of longer names, in the second byte of the version field.
const LONG_NAMES: u8 = 1 << 2;

/// Writes the channels as one ZIP-compressed part of scan lines, replacing the file atomically. Equal
/// input gives equal bytes.
///
/// # Errors
/// [`Problem::Empty`] for an image without pixels; [`Problem::Unwritable`] for a channel of another size,
/// duplicate names, or an attribute name that EXR reserves; [`Problem::Io`].
pub fn write(
    path: &Path,
    windows: Windows,
    channels: &[Channel],
    attributes: &[(String, Attribute)],
) -> Result<(), ImageError> {
    replace(path, encode(windows, channels, attributes))
}

/// Writes the channels as [`write()`] does, with the metadata of another file. What holds for that file alone is left out:
/// names of layers and views, its preview, the attributes whose names `is_kept` refuses. `attributes` take the place of others of
/// their names.
///
/// # Errors
/// As for [`write()`].
pub fn write_with_metadata(
    path: &Path,
    windows: Windows,
    channels: &[Channel],
    attributes: &[(String, Attribute)],
    metadata: &Metadata,
    is_kept: impl Fn(&str) -> bool,
) -> Result<(), ImageError> {
    let mut metadata = metadata.clone();
    metadata.shared.other.retain(|name, _| is_kept(&string(name)));
    metadata.own.other.retain(|name, _| is_kept(&string(name)));
    replace(path, encode_with_metadata(windows, channels, attributes, metadata))
}

fn replace(path: &Path, encoded: Result<Vec<u8>, Problem>) -> Result<(), ImageError> {
    encoded
        .and_then(|bytes| replace_file(path, |writer| Ok(writer.write_all(&bytes)?)))
        .map_err(|problem: Problem| problem.at(path))
}

/// Encodes the channels as the bytes of a file. Encoding in memory, which is small compared with the
/// pixel-statistics store, leaves I/O as the only failure of writing.
///
/// # Errors
/// As for [`write()`], except [`Problem::Io`].
pub fn encode(
    windows: Windows,
    channels: &[Channel],
    attributes: &[(String, Attribute)],
) -> Result<Vec<u8>, Problem> {
    encode_with_metadata(windows, channels, attributes, Metadata::default())
}

fn encode_with_metadata(
    windows: Windows,
    channels: &[Channel],
    attributes: &[(String, Attribute)],
    metadata: Metadata,
) -> Result<Vec<u8>, Problem> {
    let channels = sorted(windows, channels)?;
    let header = header(windows, &channels, attributes, metadata);
    // Room for a file that does not compress, so that it is never moved; the system provides what is written.
    let bytes_per_pixel: usize = channels.iter().map(|channel| channel.precision.bytes()).sum();
    let most = windows.width() * windows.height() * bytes_per_pixel;
    let mut file = Cursor::new(Vec::with_capacity(most));
    // `Option` collects to the `SmallVec` of one header.
    let headers = Some(header).into_iter().collect();
    exr::block::write(&mut file, headers, true, |meta, writer| {
        let header = &meta.headers[0];
        let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
        let [_, _, top, _] = windows.data;
        // This runs in rayon's current pool instead of one of the `exr` crate, so that `--threads`
        // applies.
        let chunks: Vec<_> = blocks
            .into_par_iter()
            .map_init(Encoder::default, |encoder, (index, block)| {
                let lines = UncompressedBlock::from_lines(&header.channels, block, |line| {
                    fill_line(line, &channels, windows.width());
                });
                let compressed = CompressedScanLineBlock {
                    y_coordinate: top + block.pixel_position.y() as i32,
                    compressed_pixels_le: encoder.compress(lines.data),
                };
                (index, Chunk { layer_index: 0, compressed_block: CompressedBlock::ScanLine(compressed) })
            })
            .collect();
        chunks.into_iter().try_for_each(|(index, chunk)| writer.write_chunk(index, chunk))
    })
    .map_err(|error| Problem::Unwritable(error.to_string()))?;
    let mut bytes = file.into_inner();
    if channels.iter().any(|channel| channel.name.len() > LONGEST_SHORT_NAME) {
        // The `exr` crate leaves it to other names; OpenEXR refuses long names without it
        bytes[super::MAGIC.len() + 1] |= LONG_NAMES;
    }
    sort_attributes(&mut bytes);
    Ok(bytes)
}

/// Checks the channels, and sorts them by name, as EXR requires.
fn sorted<'a, 'b>(windows: Windows, channels: &'b [Channel<'a>]) -> Result<Vec<&'b Channel<'a>>, Problem> {
    let (width, height) = (windows.width(), windows.height());
    if width == 0 || height == 0 || channels.is_empty() {
        return Err(Problem::Empty);
    }
    let mut channels: Vec<_> = channels.iter().collect();
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    for channel in &channels {
        if channel.values.len() != width * height {
            let (name, count) = (&channel.name, channel.values.len());
            let message = format!("channel {name} has {count} values for {width}x{height} pixels");
            return Err(Problem::Unwritable(message));
        }
    }
    if let Some(pair) = channels.windows(2).find(|pair| pair[0].name == pair[1].name) {
        return Err(Problem::Unwritable(format!("channel {} appears twice", pair[0].name)));
    }
    Ok(channels)
}

/// The header of the one part.
fn header(
    windows: Windows,
    channels: &[&Channel],
    attributes: &[(String, Attribute)],
    metadata: Metadata,
) -> Header {
    let descriptions = channels.iter().map(|channel| {
        let sample_type = match channel.precision {
            Precision::Half => SampleType::F16,
            Precision::Float => SampleType::F32,
        };
        ChannelDescription::new(text(&channel.name), sample_type, false)
    });
    let Windows { data: [x0, _, y0, _], display: [left, right, top, bottom] } = windows;
    let Metadata { mut shared, own } = sanitised(metadata);
    let mut own = LayerAttributes {
        layer_name: None,
        layer_position: Vec2(x0, y0),
        multi_view_names: None,
        view_name: None,
        deep_image_state: None,
        preview: None,
        ..own
    };
    attribute::insert(&mut own, attributes);
    shared.display_window = IntegerBounds::new(Vec2(left, top), Vec2(side(left, right), side(top, bottom)));
    shared.other.retain(|name, _| !own.other.contains_key(name));
    Header::new(text(""), Vec2(windows.width(), windows.height()), descriptions.collect())
        .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_shared_attributes(shared)
        .with_attributes(own)
}

/// Leaves out what other programs wrote against the rules, which reading allows and writing does not.
fn sanitised(metadata: Metadata) -> Metadata {
    let Metadata { mut shared, mut own } = metadata;
    if !(1e-6..=1e6).contains(&shared.pixel_aspect) {
        shared.pixel_aspect = 1.0;
    }
    shared.time_code = shared.time_code.filter(|code| code.validate(true).is_ok());
    own.screen_window_width = own.screen_window_width.max(0.0);
    for other in [&mut shared.other, &mut own.other] {
        other.retain(|name, value| {
            let is_reserved = standard_names::ALL.contains(&name.as_slice());
            !is_reserved && value.validate(false, IntegerBounds::zero(), true).is_ok()
        });
    }
    Metadata { shared, own }
}

/// Converts one row of one channel to little-endian bytes of its stored type.
fn fill_line(line: LineRefMut, channels: &[&Channel], width: usize) {
    let channel = channels[line.location.channel];
    let Vec2(x, y) = line.location.position;
    let values = &channel.values[y * width + x..][..line.location.sample_count];
    match channel.precision {
        Precision::Float => {
            let (out, _) = line.value.as_chunks_mut();
            out.iter_mut().zip(values).for_each(|(bytes, value)| *bytes = value.to_le_bytes());
        }
        Precision::Half => {
            let (out, _) = line.value.as_chunks_mut();
            out.iter_mut().zip(values).for_each(|(bytes, &value)| *bytes = to_half(value).to_le_bytes());
        }
    }
}

/// Rounds to 16 bits; finite values stay finite.
fn to_half(value: f32) -> f16 {
    let half = f16::from_f32(value);
    if half.is_infinite() && value.is_finite() { f16::MAX.copysign(half) } else { half }
}

/// Sorts the header's attributes by name, in place.
///
/// The `exr` crate stores them in a hash map, whose order changes from run to run; equal images must give
/// equal bytes. A header is a sequence of (name, 0, type, 0, size as 32-bit little endian, that many
/// bytes), ended by an empty name.
fn sort_attributes(file: &mut [u8]) {
    const VERSION_BYTES: usize = 4;
    let start = super::MAGIC.len() + VERSION_BYTES;
    let mut attributes = Vec::new();
    let mut rest = &file[start..];
    while let Some(length) = attribute_length(rest) {
        let (attribute, after) = rest.split_at(length);
        attributes.push(attribute.to_vec());
        rest = after;
    }
    // Names end in 0, so comparing attributes bytewise compares names first.
    attributes.sort();
    let sorted = attributes.concat();
    file[start..start + sorted.len()].copy_from_slice(&sorted);
}

/// Length in bytes of the attribute at the start of `bytes`; `None` at the end of the header.
fn attribute_length(bytes: &[u8]) -> Option<usize> {
    let zero_after = |start: usize| Some(start + bytes.get(start..)?.iter().position(|&byte| byte == 0)?);
    let name_end = zero_after(0).filter(|&end| end > 0)?;
    let size_start = zero_after(name_end + 1)? + 1;
    let size = bytes.get(size_start..size_start + 4)?;
    Some(size_start + 4 + u32::from_le_bytes(size.try_into().ok()?) as usize)
}
