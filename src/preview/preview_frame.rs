//! Encodes an image for the page: a header, then half floats, pixel by pixel.
//!
//! Takes the planes of one view; gives the bytes that are sent to every viewer. A coarse image is sent as the values of its squares: the page
//! enlarges it.

use axum::body::Bytes;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

use super::view::View;
use crate::image::Planes;

/// Version of the header's layout.
const VERSION: u8 = 2;
/// Length of the header, in bytes. All numbers are little endian: version, view, channels, side (u8 each); width,
/// height of the whole image (u16); generation, sequence (u32); samples per pixel, seconds (f32); grid (u8); three bytes of 0.
pub const HEADER: usize = 28;
/// The largest finite half float; larger values are clamped to it.
const LARGEST: f32 = 65504.0;

/// One view at one moment, encoded.
#[derive(Clone, Debug)]
pub struct PreviewFrame {
    pub view: View,
    pub channels: usize,
    /// Size of the whole image, in pixels.
    pub width: usize,
    pub height: usize,
    /// Side in pixels of the squares that have one value each: 1 for pixels.
    pub grid: usize,
    /// Counts restarts and camera moves: frames of different generations show different images.
    pub generation: u32,
    /// Counts all frames.
    pub sequence: u32,
    pub bytes: Bytes,
}

/// The part of the header that does not follow from the image.
#[derive(Clone, Copy, Debug)]
pub struct FrameInfo {
    pub generation: u32,
    pub sequence: u32,
    /// Mean samples per pixel.
    pub spp: f32,
    /// Render time in seconds.
    pub seconds: f32,
    /// Side in pixels of the squares that one value was made for: 1 unless the image is coarse.
    pub side: u8,
}

impl PreviewFrame {
    /// Encodes `planes` (1 or 3). With `counts`, the samples of each pixel, pixels without samples show a neighbour
    /// that has some.
    pub fn new(view: View, planes: &Planes, counts: Option<&[u32]>, info: FrameInfo) -> Self {
        Self::encode(view, planes, counts, (planes.width(), planes.height()), 1, info)
    }

    /// Encodes an image of `size` pixels that has one value for each square of `info.side` pixels.
    pub fn coarse(view: View, squares: &Planes, size: (usize, usize), info: FrameInfo) -> Self {
        Self::encode(view, squares, None, size, info.side, info)
    }

    /// Returns the frame of a coarse image with a value for each pixel: that of its square.
    pub fn enlarged(&self) -> Self {
        let value = self.channels * size_of::<u16>();
        let columns = self.width.div_ceil(self.grid);
        let (head, squares) = self.bytes.split_at(HEADER);
        let mut bytes = head.to_vec();
        bytes[24] = 1;
        for y in 0..self.height {
            let row = &squares[y / self.grid * columns * value..];
            (0..self.width).for_each(|x| bytes.extend(&row[x / self.grid * value..][..value]));
        }
        Self { grid: 1, bytes: bytes.into(), ..self.clone() }
    }

    fn encode(
        view: View,
        planes: &Planes,
        counts: Option<&[u32]>,
        size: (usize, usize),
        grid: u8,
        info: FrameInfo,
    ) -> Self {
        let (width, height, channels) = (planes.width(), planes.height(), planes.count());
        let row_bytes = width * channels * size_of::<u16>();
        let mut bytes = vec![0; HEADER + row_bytes * height];
        // Write the header
        let (head, pixels) = bytes.split_at_mut(HEADER);
        head[0..4].copy_from_slice(&[VERSION, view.index() as u8, channels as u8, info.side]);
        head[4..6].copy_from_slice(&(size.0 as u16).to_le_bytes());
        head[6..8].copy_from_slice(&(size.1 as u16).to_le_bytes());
        head[8..12].copy_from_slice(&info.generation.to_le_bytes());
        head[12..16].copy_from_slice(&info.sequence.to_le_bytes());
        head[16..20].copy_from_slice(&info.spp.to_le_bytes());
        head[20..24].copy_from_slice(&info.seconds.to_le_bytes());
        head[24] = grid;

        // Interleave and convert the rows
        let stand_ins = counts.map(|counts| StandIns::new(counts, width));
        pixels.par_chunks_mut(row_bytes.max(1)).enumerate().for_each(|(y, out)| {
            let mut values = vec![0.0; width * channels];
            let sources: Option<Vec<_>> =
                stand_ins.as_ref().map(|found| (0..width).map(|x| found.nearest_sampled(x, y)).collect());
            for channel in 0..channels {
                let plane = planes.plane(channel);
                let row = &plane[y * width..][..width];
                for (x, value) in values.iter_mut().skip(channel).step_by(channels).enumerate() {
                    let found = sources.as_ref().map_or(row[x], |sources| plane[sources[x]]);
                    *value = found.clamp(-LARGEST, LARGEST);
                }
            }
            let mut halves = vec![f16::ZERO; values.len()];
            halves.convert_from_f32_slice(&values);
            for (out, half) in out.as_chunks_mut::<2>().0.iter_mut().zip(halves) {
                *out = half.to_le_bytes();
            }
        });

        let ((width, height), grid) = (size, grid.into());
        let (generation, sequence) = (info.generation, info.sequence);
        Self { view, channels, width, height, grid, generation, sequence, bytes: bytes.into() }
    }
}

/// Sides of the blocks in which a pixel without samples finds one that has some.
const BLOCK_SIDES: [usize; 3] = [2, 4, 8];

/// The pixels that stand in for those without samples.
struct StandIns<'c> {
    counts: &'c [u32],
    width: usize,
    /// For each side of [`BLOCK_SIDES`], the first pixel with samples of every block, row by row.
    blocks: [Vec<Option<u32>>; 3],
}

impl<'c> StandIns<'c> {
    fn new(counts: &'c [u32], width: usize) -> Self {
        let height = counts.len() / width.max(1);
        // A block's pixel is that of the first of its four quarters that has one.
        let first =
            |side: usize, quarter: &(dyn Fn(usize, usize) -> Option<u32> + Sync)| -> Vec<Option<u32>> {
                let half = side / 2;
                let (columns, rows) = (width.div_ceil(half), height.div_ceil(half));
                let block = |x: usize, y: usize| {
                    let quarters = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| (2 * x + i, 2 * y + j));
                    let inside = quarters.into_iter().filter(|&(x, y)| x < columns && y < rows);
                    inside.into_iter().find_map(|(x, y)| quarter(x, y))
                };
                let length = width.div_ceil(side);
                let mut blocks = vec![None; length * height.div_ceil(side)];
                blocks.par_chunks_mut(length.max(1)).enumerate().for_each(|(y, row)| {
                    row.iter_mut().enumerate().for_each(|(x, found)| *found = block(x, y));
                });
                blocks
            };
        let pixel = |x: usize, y: usize| (counts[y * width + x] > 0).then_some((y * width + x) as u32);
        let two = first(2, &pixel);
        let four = first(4, &|x, y| two[y * width.div_ceil(2) + x]);
        let eight = first(8, &|x, y| four[y * width.div_ceil(4) + x]);
        Self { counts, width, blocks: [two, four, eight] }
    }

    /// Returns the index of the pixel that pixel (x, y) shows: itself if it has samples, else a pixel with samples in the
    /// smallest block around it that has one.
    fn nearest_sampled(&self, x: usize, y: usize) -> usize {
        let own = y * self.width + x;
        if self.counts[own] > 0 {
            return own;
        }
        let mut blocks = BLOCK_SIDES.iter().zip(&self.blocks);
        blocks
            .find_map(|(side, first)| first[y / side * self.width.div_ceil(*side) + x / side])
            .map_or(own, |index| index as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INFO: FrameInfo = FrameInfo { generation: 2, sequence: 7, spp: 1.5, seconds: 3.0, side: 4 };

    fn halves(frame: &PreviewFrame) -> Vec<f32> {
        let pairs = frame.bytes[HEADER..].as_chunks::<2>().0.iter();
        pairs.map(|&pair| f16::from_le_bytes(pair).to_f32()).collect()
    }

    #[test]
    fn pixels_are_interleaved_half_floats_behind_the_header() {
        let mut planes = Planes::new(2, 1, 3);
        planes.data_mut().copy_from_slice(&[0.0, 1.0, 2.0, 3.0, 1e9, f32::NEG_INFINITY]);
        let frame = PreviewFrame::new(View::Raw, &planes, None, INFO);
        assert_eq!(halves(&frame), [0.0, 2.0, 65504.0, 1.0, 3.0, -65504.0]);
        assert_eq!(frame.bytes[..8], [2, 1, 3, 4, 2, 0, 1, 0]);
        assert_eq!(frame.bytes[8..16], [2, 0, 0, 0, 7, 0, 0, 0]);
        assert_eq!(frame.bytes[24..HEADER], [1, 0, 0, 0]);
    }

    #[test]
    fn a_coarse_image_has_one_value_for_each_square() {
        let mut squares = Planes::new(2, 1, 1);
        squares.data_mut().copy_from_slice(&[0.5, 0.25]);
        let frame = PreviewFrame::coarse(View::Filtered, &squares, (7, 3), INFO);
        assert_eq!(halves(&frame), [0.5, 0.25]);
        assert_eq!(frame.bytes[4..8], [7, 0, 3, 0]);
        assert_eq!((frame.width, frame.height, frame.grid, frame.bytes[24]), (7, 3, 4, 4));

        let enlarged = frame.enlarged();
        let row = [0.5, 0.5, 0.5, 0.5, 0.25, 0.25, 0.25];
        assert_eq!(halves(&enlarged), [row; 3].as_flattened());
        assert_eq!((enlarged.grid, enlarged.bytes[24]), (1, 1));
    }

    #[test]
    fn pixels_without_samples_take_their_blocks_colour() {
        let mut planes = Planes::new(4, 4, 1);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = i as f32);
        let mut counts = vec![0; 16];
        counts[0] = 1;
        counts[10] = 1;
        let shown = halves(&PreviewFrame::new(View::Raw, &planes, Some(&counts), INFO));
        let mut expected = [0.0; 16];
        // The block of 2×2 that pixel 10 is in.
        [10, 11, 14, 15].into_iter().for_each(|i| expected[i] = 10.0);
        assert_eq!(shown, expected);
    }
}
