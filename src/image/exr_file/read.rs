//! Reading: the header is checked before anything is allocated, then blocks are decompressed side
//! by side and only the wanted channels are kept.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
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
use super::{Attribute, Windows};
use crate::image::error::{MAX_SAMPLES, MAX_SIDE};
use crate::image::{ImageError, Planes, Problem};

/// What the header of a file's first part says.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrInfo {
    pub width: usize,
    pub height: usize,
    /// `None` where the pixels do not lie inside an image that starts at (0, 0).
    pub windows: Option<Windows>,
    /// Full names, sorted.
    pub channels: Vec<String>,
    /// Texts, integers, floats and lists of integers, sorted by name.
    pub attributes: Vec<(String, Attribute)>,
}

/// Reads the header alone.
pub fn read_info(path: &Path) -> Result<ExrInfo, ImageError> {
    guarded(|| {
        let reader = open(BufReader::new(File::open(path)?))?;
        let header = &reader.headers()[0];
        Ok(ExrInfo {
            width: header.layer_size.width(),
            height: header.layer_size.height(),
            windows: windows(header),
            channels: channel_names(header),
            attributes: attribute::extract(header.own_attributes.clone()),
        })
    })
    .map_err(|problem| problem.at(path))
}

/// Reads the channels of these names as one plane each, in this order, whatever type they are
/// stored in. In a file of several parts the first one that has them all is taken.
///
/// # Errors
/// [`Problem::MissingChannels`]; [`Problem::TooLarge`]; [`Problem::Unsupported`] for DWA
/// compression, deep data and subsampled channels; [`Problem::Malformed`] for a damaged file.
pub fn read_channels(path: &Path, names: &[&str]) -> Result<Planes, ImageError> {
    read_first_of(path, &[names.iter().map(|name| name.to_string()).collect()])
}

/// Reads a layer as three planes: its `R` `G` `B`, or `X` `Y` `Z`, or its only channel (`Y` or
/// `X`) three times. `None` is the picture itself, whose channels have no prefix.
///
/// # Errors
/// Those of [`read_channels`].
pub fn read_layer(path: &Path, layer: Option<&str>) -> Result<Planes, ImageError> {
    read_first_of(path, &layer_channels(layer))
}

/// The sets of channels that a layer may have.
pub(super) fn layer_channels(layer: Option<&str>) -> Vec<Vec<String>> {
    let full_name = |channel: &str| layer.map_or(channel.into(), |layer| format!("{layer}.{channel}"));
    let choices = [["R", "G", "B"], ["X", "Y", "Z"], ["Y"; 3], ["X"; 3]];
    choices.map(|channels| channels.map(full_name).to_vec()).to_vec()
}

fn read_first_of(path: &Path, choices: &[Vec<String>]) -> Result<Planes, ImageError> {
    let file = File::open(path).map_err(|error| Problem::Io(error).at(path))?;
    decode_first_of(BufReader::new(file), choices).map_err(|problem| problem.at(path))
}

/// Reads the first of these sets of channels that a part of the file has.
pub(super) fn decode_first_of(source: impl Read + Seek, choices: &[Vec<String>]) -> Result<Planes, Problem> {
    guarded(|| {
        let reader = open(source)?;
        let parts = reader.headers().iter().enumerate();
        let found = parts
            .flat_map(|(part, header)| choices.iter().map(move |names| (part, find(header, names))))
            .find_map(|(part, indices)| Some((part, indices?)));
        match found {
            Some((part, channels)) => decode(reader, part, &channels),
            None => Err(Problem::MissingChannels {
                wanted: choices[0].clone(),
                present: reader.headers().iter().flat_map(channel_names).collect(),
            }),
        }
    })
}

/// Turns a panic inside the decoder into an error.
///
/// A damaged file must not end a render. The `exr` crate forbids unsafe code but computes on trust
/// in places: with overflow checks on, a flipped bit in a B44 block makes it panic. Nothing
/// outlives the call, so nothing half-changed can be seen afterwards.
fn guarded<T>(read: impl FnOnce() -> Result<T, Problem>) -> Result<T, Problem> {
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(Problem::Malformed("its contents contradict each other".into())))
}

/// Reads the headers and checks what they ask for.
fn open<R: Read + Seek>(mut source: R) -> Result<Reader<R>, Problem> {
    let file_bytes = source.seek(SeekFrom::End(0))?;
    source.rewind()?;
    let reader = exr::block::read(source, false)?;
    for header in reader.headers() {
        check(header, file_bytes)?;
    }
    Ok(reader)
}

fn check(header: &Header, file_bytes: u64) -> Result<(), Problem> {
    let Vec2(width, height) = header.layer_size;
    let channels = header.channels.list.len();
    let samples = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channels));
    if width > MAX_SIDE || height > MAX_SIDE || samples.is_none_or(|samples| samples > MAX_SAMPLES) {
        return Err(Problem::TooLarge { width, height, channels });
    }
    if width == 0 || height == 0 || channels == 0 {
        return Err(Problem::Empty);
    }
    // Each block has an entry of eight bytes in the file's offset table.
    if header.chunk_count as u64 > file_bytes / 8 {
        return Err(Problem::Malformed("the file is shorter than its header says".into()));
    }
    if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Err(Problem::Unsupported("DWA compression".into()));
    }
    if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return Err(Problem::Unsupported("subsampled channels".into()));
    }
    Ok(())
}

fn windows(header: &Header) -> Option<Windows> {
    let display = header.shared_attributes.display_window;
    let Vec2(x, y) = header.own_attributes.layer_position;
    let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
    let Vec2(width, height) = header.layer_size;
    let windows = Windows {
        data: [x, x + width, y, y + height],
        display: [display.size.width(), display.size.height()],
    };
    let inside = windows.data[1] <= windows.display[0] && windows.data[3] <= windows.display[1];
    (display.position == Vec2(0, 0) && inside).then_some(windows)
}

fn channel_names(header: &Header) -> Vec<String> {
    header.channels.list.iter().map(|channel| string(&channel.name)).collect()
}

/// Indices of these channels in the header, in the order of the names; `None` if one is missing.
fn find(header: &Header, names: &[String]) -> Option<Vec<usize>> {
    let present = channel_names(header);
    names.iter().map(|name| present.iter().position(|present| present == name)).collect()
}

/// The full-resolution pixels of some channels of one part.
fn decode<R: Read + Seek>(reader: Reader<R>, part: usize, channels: &[usize]) -> Result<Planes, Problem> {
    // Enough blocks at a time to keep all threads busy, few enough to bound the memory.
    const BLOCKS_PER_THREAD: usize = 4;
    let at_once = BLOCKS_PER_THREAD * rayon::current_num_threads();

    let meta = reader.meta_data().clone();
    let Vec2(width, height) = meta.headers[part].layer_size;
    let mut planes = Planes::new(width, height, channels.len());
    let mut seen = HashSet::new();
    let mut chunks =
        reader.filter_chunks(true, |_, tile, block| block.layer == part && tile.level_index == Vec2(0, 0))?;
    loop {
        // Rayon's current pool, not the one that `exr` would make: a panic in the latter aborts.
        let batch: Vec<Chunk> = chunks.by_ref().take(at_once).collect::<Result<_, _>>()?;
        if batch.is_empty() {
            return Ok(planes);
        }
        let blocks: Vec<UncompressedBlock> = batch
            .into_par_iter()
            .map(|chunk| UncompressedBlock::decompress_chunk(chunk, &meta, true))
            .collect::<Result<_, _>>()?;
        for block in &blocks {
            // As many blocks are read as there should be, so none is missing if none is misplaced.
            let Vec2(x, y) = block.index.pixel_position;
            if block.index.layer != part || block.index.level != Vec2(0, 0) || !seen.insert((x, y)) {
                return Err(Problem::Malformed("a block of pixels is missing".into()));
            }
            keep(block, &meta.headers[part], channels, &mut planes);
        }
    }
}

/// Copies the wanted channels of a block into their planes.
fn keep(block: &UncompressedBlock, header: &Header, channels: &[usize], planes: &mut Planes) {
    let width = planes.width();
    for line in block.lines(&header.channels) {
        let Vec2(x, y) = line.location.position;
        let sample_type = header.channels.list[line.location.channel].sample_type;
        for (plane, _) in channels.iter().enumerate().filter(|(_, wanted)| **wanted == line.location.channel)
        {
            let row = &mut planes.plane_mut(plane)[y * width + x..][..line.location.sample_count];
            convert(line.value, sample_type, row);
        }
    }
}

/// Stored bytes to `f32`.
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
