//! Reads OpenEXR files. The header is checked before memory is allocated; blocks are then decompressed in
//! parallel, and the requested channels copied.

use std::collections::HashSet;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::block::reader::Reader;
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use half::f16;
use rayon::prelude::*;

use super::attribute::{self, string};
use super::{Attribute, Metadata, Windows};
use crate::image::error::{MAX_SAMPLES, MAX_SIDE};
use crate::image::read_rgb::open_file;
use crate::image::{ImageError, Planes, Problem};
use crate::memory::check_available;

/// The contents of the header of one part of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrInfo {
    pub width: usize,
    pub height: usize,
    pub windows: Windows,
    /// Full names, sorted.
    pub channels: Vec<String>,
    /// Texts, integers, floats and lists of integers, sorted by name.
    pub attributes: Vec<(String, Attribute)>,
    /// Chromaticities (x, y) of red, green and blue, if the file states them.
    pub primaries: Option<[[f32; 2]; 3]>,
}

/// A part of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrPart {
    pub name: Option<String>,
    pub info: ExrInfo,
}

/// Reads the header of the first part only.
///
/// # Errors
/// As for [`read_channels`], except missing channels.
pub fn read_info(path: &Path) -> Result<ExrInfo, ImageError> {
    read_headers(path, |headers| info(&headers[0]))
}

/// Reads the headers of all parts.
///
/// # Errors
/// As for [`read_channels`], except missing channels.
pub fn read_parts(path: &Path) -> Result<Vec<ExrPart>, ImageError> {
    let part = |header: &Header| ExrPart {
        name: header.own_attributes.layer_name.as_ref().map(string),
        info: info(header),
    };
    read_headers(path, |headers| headers.iter().map(part).collect())
}

/// Reads what the header of a part says beside the image: of the first part, if there are not as many.
///
/// # Errors
/// As for [`read_channels`], except missing channels.
pub fn read_metadata(path: &Path, part: usize) -> Result<Metadata, ImageError> {
    read_headers(path, |headers| {
        let header = headers.get(part).unwrap_or(&headers[0]);
        Metadata { shared: header.shared_attributes.clone(), own: header.own_attributes.clone() }
    })
}

fn read_headers<T>(path: &Path, read: impl Fn(&[Header]) -> T) -> Result<T, ImageError> {
    catch_panic(|| Ok(read(open(BufReader::new(open_file(path)?))?.headers())))
        .map_err(|problem| problem.at(path))
}

fn info(header: &Header) -> ExrInfo {
    ExrInfo {
        width: header.layer_size.width(),
        height: header.layer_size.height(),
        windows: windows(header),
        channels: channel_names(header),
        attributes: attribute::extract(header.own_attributes.clone()),
        primaries: header
            .shared_attributes
            .chromaticities
            .map(|found| [found.red, found.green, found.blue].map(|Vec2(x, y)| [x, y])),
    }
}

/// Reads the channels of these names as one plane each, in this order, from any stored type. Of a file's
/// parts, the first one that has all channels is read.
///
/// # Errors
/// [`Problem::MissingChannels`]; [`Problem::TooLarge`]; [`Problem::Memory`]; [`Problem::Unsupported`] for DWA
/// compression, deep data and subsampled channels; [`Problem::Malformed`] for a damaged file.
pub fn read_channels(path: &Path, names: &[&str]) -> Result<Planes, ImageError> {
    read_first_present(path, &[names.iter().map(|name| name.to_string()).collect()])
}

/// Reads the channels of these names of one part as one plane each, in this order.
///
/// # Errors
/// Those of [`read_channels`].
pub fn read_part(path: &Path, part: usize, names: &[&str]) -> Result<Planes, ImageError> {
    let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
    catch_panic(|| {
        let reader = open(BufReader::new(open_file(path)?))?;
        let header = reader.headers().get(part);
        match header.and_then(|header| channel_indices(header, &names)) {
            Some(channels) => decode(reader, part, &channels),
            None => Err(missing(reader.headers(), &names)),
        }
    })
    .map_err(|problem| problem.at(path))
}

fn missing(headers: &[Header], wanted: &[String]) -> Problem {
    Problem::MissingChannels {
        wanted: wanted.to_vec(),
        present: headers.iter().flat_map(channel_names).collect(),
    }
}

/// Reads a layer as three planes: its `R` `G` `B`, or `X` `Y` `Z`, or its only channel (`Y` or
/// `X`) three times. `None` is the image itself, whose channels have no prefix.
///
/// # Errors
/// Those of [`read_channels`].
pub fn read_layer(path: &Path, layer: Option<&str>) -> Result<Planes, ImageError> {
    read_first_present(path, &layer_channels(layer))
}

/// The sets of channels that a layer may have, in order of preference.
pub(super) fn layer_channels(layer: Option<&str>) -> Vec<Vec<String>> {
    let full_name = |channel: &str| layer.map_or(channel.into(), |layer| format!("{layer}.{channel}"));
    let choices = [["R", "G", "B"], ["X", "Y", "Z"], ["Y"; 3], ["X"; 3]];
    choices.map(|channels| channels.map(full_name).to_vec()).to_vec()
}

fn read_first_present(path: &Path, choices: &[Vec<String>]) -> Result<Planes, ImageError> {
    let file = open_file(path).map_err(|problem| problem.at(path))?;
    decode_first_present(BufReader::new(file), choices).map_err(|problem| problem.at(path))
}

/// Reads the first of these sets of channels that some part of the file has.
pub(super) fn decode_first_present(
    source: impl Read + Seek,
    choices: &[Vec<String>],
) -> Result<Planes, Problem> {
    catch_panic(|| {
        let reader = open(source)?;
        let parts = reader.headers().iter().enumerate();
        let found = parts
            .flat_map(|(part, header)| {
                choices.iter().map(move |names| (part, channel_indices(header, names)))
            })
            .find_map(|(part, indices)| Some((part, indices?)));
        match found {
            Some((part, channels)) => decode(reader, part, &channels),
            None => Err(missing(reader.headers(), &choices[0])),
        }
    })
}

/// Turns a panic inside the decoder into an error.
///
/// A damaged file must not end a render. The `exr` crate forbids unsafe code but does not check all
/// arithmetic: with overflow checks on, a flipped bit in a B44 block makes it panic. No state outlives the
/// call, so the caller sees none that is half changed.
fn catch_panic<T>(read: impl FnOnce() -> Result<T, Problem>) -> Result<T, Problem> {
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(Problem::Malformed("its contents are inconsistent".into())))
}

/// Reads and checks the headers.
fn open<R: Read + Seek>(mut source: R) -> Result<Reader<R>, Problem> {
    let file_bytes = source.seek(SeekFrom::End(0))?;
    check_magic(&mut source)?;
    source.rewind()?;
    let reader = exr::block::read(source, false)?;
    for header in reader.headers() {
        check(header, file_bytes)?;
    }
    Ok(reader)
}

/// Checks that a file begins as an EXR does.
fn check_magic<R: Read + Seek>(source: &mut R) -> Result<(), Problem> {
    source.rewind()?;
    let mut start = [0; super::MAGIC.len()];
    match source.read_exact(&mut start) {
        Ok(()) if start == super::MAGIC => Ok(()),
        Err(error) if error.kind() != ErrorKind::UnexpectedEof => Err(error.into()),
        _ => Err(Problem::Unsupported("the file is not an EXR image".into())),
    }
}

/// Checks a header's sizes, and that its features are supported.
fn check(header: &Header, file_bytes: u64) -> Result<(), Problem> {
    let Vec2(width, height) = header.layer_size;
    let channels = header.channels.list.len();
    let is_large = width.checked_mul(height).is_none_or(|pixels| pixels > MAX_SAMPLES);
    if width > MAX_SIDE || height > MAX_SIDE || is_large {
        return Err(Problem::TooLarge { width, height, channels });
    }
    if width == 0 || height == 0 || channels == 0 {
        return Err(Problem::Empty);
    }
    // The file's offset table has eight bytes for each block.
    if header.chunk_count as u64 > file_bytes / 8 {
        return Err(Problem::Malformed("the file is shorter than its header claims".into()));
    }
    if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Err(Problem::Unsupported("it uses DWA compression".into()));
    }
    if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return Err(Problem::Unsupported("it has subsampled channels".into()));
    }
    Ok(())
}

/// Data and display window.
fn windows(header: &Header) -> Windows {
    let display = header.shared_attributes.display_window;
    let bounds = |Vec2(x, y): Vec2<i32>, Vec2(width, height): Vec2<usize>| {
        [x, x.saturating_add_unsigned(width as u32), y, y.saturating_add_unsigned(height as u32)]
    };
    Windows {
        data: bounds(header.own_attributes.layer_position, header.layer_size),
        display: bounds(display.position, display.size),
    }
}

fn channel_names(header: &Header) -> Vec<String> {
    header.channels.list.iter().map(|channel| string(&channel.name)).collect()
}

/// Indices of these channels in the header, in the order of the names; `None` if one is missing.
fn channel_indices(header: &Header, names: &[String]) -> Option<Vec<usize>> {
    let present = channel_names(header);
    names.iter().map(|name| present.iter().position(|present| present == name)).collect()
}

/// The full-resolution pixels of some channels of one part.
fn decode<R: Read + Seek>(reader: Reader<R>, part: usize, channels: &[usize]) -> Result<Planes, Problem> {
    // Some blocks per thread keep all threads busy and bound the memory.
    const BLOCKS_PER_THREAD: usize = 4;
    let batch_len = BLOCKS_PER_THREAD * rayon::current_num_threads();

    let meta = reader.meta_data().clone();
    let Vec2(width, height) = meta.headers[part].layer_size;
    let samples = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channels.len()));
    let Some(samples) = samples.filter(|&samples| samples <= MAX_SAMPLES) else {
        return Err(Problem::TooLarge { width, height, channels: channels.len() });
    };
    // Blocks have all channels, whichever are read
    let blocks = (meta.headers[part].max_block_byte_size() * batch_len) as u64;
    check_available((samples * size_of::<f32>()) as u64 + blocks).map_err(Problem::Memory)?;
    let mut planes = Planes::new(width, height, channels.len());
    let mut seen = HashSet::new();
    let mut chunks =
        reader.filter_chunks(true, |_, tile, block| block.layer == part && tile.level_index == Vec2(0, 0))?;
    loop {
        // This runs in rayon's current pool: a panic in a pool of the `exr` crate would abort.
        let batch: Vec<Chunk> = chunks.by_ref().take(batch_len).collect::<Result<_, _>>()?;
        if batch.is_empty() {
            return Ok(planes);
        }
        let blocks: Vec<UncompressedBlock> = batch
            .into_par_iter()
            .map(|chunk| UncompressedBlock::decompress_chunk(chunk, &meta, true))
            .collect::<Result<_, _>>()?;
        for block in &blocks {
            // The number of blocks read is right, so none is missing if none is misplaced or repeated.
            let Vec2(x, y) = block.index.pixel_position;
            if block.index.layer != part || block.index.level != Vec2(0, 0) || !seen.insert((x, y)) {
                return Err(Problem::Malformed("a block of pixels is missing".into()));
            }
            copy_channels(block, &meta.headers[part], channels, &mut planes);
        }
    }
}

/// Copies the requested channels of a block to their planes.
fn copy_channels(block: &UncompressedBlock, header: &Header, channels: &[usize], planes: &mut Planes) {
    let width = planes.width();
    for line in block.lines(&header.channels) {
        let Vec2(x, y) = line.location.position;
        let sample_type = header.channels.list[line.location.channel].sample_type;
        for (plane, _) in
            channels.iter().enumerate().filter(|(_, channel)| **channel == line.location.channel)
        {
            let row = &mut planes.plane_mut(plane)[y * width + x..][..line.location.sample_count];
            convert(line.value, sample_type, row);
        }
    }
}

/// Converts stored bytes to `f32`.
fn convert(bytes: &[u8], sample_type: SampleType, row: &mut [f32]) {
    fn fill<const N: usize>(bytes: &[u8], row: &mut [f32], value: impl Fn([u8; N]) -> f32) {
        for (to, from) in row.iter_mut().zip(bytes.as_chunks().0) {
            *to = value(*from);
        }
    }
    match sample_type {
        SampleType::F16 => fill(bytes, row, |bytes| f16::from_ne_bytes(bytes).to_f32()),
        SampleType::F32 => fill(bytes, row, f32::from_ne_bytes),
        SampleType::U32 => fill(bytes, row, |bytes| u32::from_ne_bytes(bytes) as f32),
    }
}
