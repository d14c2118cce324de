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
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use half::f16;
use rayon::prelude::*;

use super::attribute::{self, text};
use super::zip::Encoder;
use super::{Attribute, Channel, Precision, Windows};
use crate::files::replace_file;
use crate::image::{ImageError, Problem};

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
    encode(windows, channels, attributes)
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
    let channels = sorted(windows, channels)?;
    let header = header(windows, &channels, attributes)?;
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
                    y_coordinate: (top + block.pixel_position.y()) as i32,
                    compressed_pixels_le: encoder.compress(lines.data),
                };
                (index, Chunk { layer_index: 0, compressed_block: CompressedBlock::ScanLine(compressed) })
            })
            .collect();
        chunks.into_iter().try_for_each(|(index, chunk)| writer.write_chunk(index, chunk))
    })
    .map_err(|error| Problem::Unwritable(error.to_string()))?;
    let mut bytes = file.into_inner();
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
) -> Result<Header, Problem> {
    let [x0, _, y0, _] = windows.data;
    // All coordinates fit EXR's 32 bits if the largest does.
    let largest = windows.data.into_iter().chain(windows.display).max().unwrap_or_default();
    if i32::try_from(largest).is_err() {
        return Err(Problem::Unwritable("pixel bounds are too large for EXR".into()));
    }
    let descriptions = channels.iter().map(|channel| {
        let sample_type = match channel.precision {
            Precision::Half => SampleType::F16,
            Precision::Float => SampleType::F32,
        };
        ChannelDescription::new(text(&channel.name), sample_type, false)
    });
    let mut own = LayerAttributes::default().with_position(Vec2(x0 as i32, y0 as i32));
    attribute::insert(&mut own, attributes);
    let size = Vec2(windows.width(), windows.height());
    let display = Vec2(windows.display[0], windows.display[1]);
    Ok(Header::new(text(""), size, descriptions.collect())
        .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_shared_attributes(ImageAttributes::new(IntegerBounds::new(Vec2(0, 0), display)))
        .with_attributes(own))
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
