//! Encodes an image for the page: a header, then half floats, pixel by pixel.
//!
//! Takes the planes of one view; gives the bytes that are sent to every viewer.

use axum::body::Bytes;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

use super::view::View;
use crate::image::Planes;

/// Version of the header's layout.
const VERSION: u8 = 1;
/// Length of the header, in bytes. All numbers are little endian: version, view, channels, 0 (u8 each); width, height
/// (u16); generation, sequence (u32); samples per pixel, seconds (f32).
pub const HEADER: usize = 24;
/// The largest finite half float; larger values are clamped to it.
const LARGEST: f32 = 65504.0;

/// One view at one moment, encoded.
#[derive(Clone, Debug)]
pub struct PreviewFrame {
    pub view: View,
    pub channels: usize,
    pub width: usize,
    pub height: usize,
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
}

impl PreviewFrame {
    /// Encodes `planes` (1 or 3). With `counts`, the samples of each pixel, pixels without samples show a neighbour
    /// that has some.
    pub fn new(view: View, planes: &Planes, counts: Option<&[u32]>, info: FrameInfo) -> Self {
        let (width, height, channels) = (planes.width(), planes.height(), planes.count());
        let row_bytes = width * channels * size_of::<u16>();
        let mut bytes = vec![0; HEADER + row_bytes * height];
        // Write the header
        let (head, pixels) = bytes.split_at_mut(HEADER);
        head[0..4].copy_from_slice(&[VERSION, view.index() as u8, channels as u8, 0]);
        head[4..6].copy_from_slice(&(width as u16).to_le_bytes());
        head[6..8].copy_from_slice(&(height as u16).to_le_bytes());
        head[8..12].copy_from_slice(&info.generation.to_le_bytes());
        head[12..16].copy_from_slice(&info.sequence.to_le_bytes());
        head[16..20].copy_from_slice(&info.spp.to_le_bytes());
        head[20..24].copy_from_slice(&info.seconds.to_le_bytes());

        // Interleave and convert the rows
        pixels.par_chunks_mut(row_bytes.max(1)).enumerate().for_each(|(y, out)| {
            let mut values = vec![0.0; width * channels];
            for channel in 0..channels {
                let row = planes.plane(channel);
                for (x, value) in values.iter_mut().skip(channel).step_by(channels).enumerate() {
                    let from = counts.map_or(y * width + x, |counts| nearest_sampled(counts, width, x, y));
                    *value = row[from].clamp(-LARGEST, LARGEST);
                }
            }
            let mut halves = vec![f16::ZERO; values.len()];
            halves.convert_from_f32_slice(&values);
            for (out, half) in out.as_chunks_mut::<2>().0.iter_mut().zip(halves) {
                *out = half.to_le_bytes();
            }
        });

        let (generation, sequence) = (info.generation, info.sequence);
        Self { view, channels, width, height, generation, sequence, bytes: bytes.into() }
    }
}

/// Returns the index of the pixel that pixel (x, y) shows: itself if it has samples, else a pixel with samples in its
/// block of 2×2, 4×4 or 8×8 pixels, whichever is the smallest that has one.
fn nearest_sampled(counts: &[u32], width: usize, x: usize, y: usize) -> usize {
    let height = counts.len() / width.max(1);
    let in_block = |side: usize| {
        let (x0, y0) = (x / side * side, y / side * side);
        let rows = y0..(y0 + side).min(height);
        rows.flat_map(move |y| (x0..(x0 + side).min(width)).map(move |x| y * width + x))
    };
    let mut blocks = [1, 2, 4, 8].into_iter().flat_map(in_block);
    blocks.find(|&i| counts[i] > 0).unwrap_or(y * width + x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INFO: FrameInfo = FrameInfo { generation: 2, sequence: 7, spp: 1.5, seconds: 3.0 };

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
        assert_eq!(frame.bytes[..8], [1, 1, 3, 0, 2, 0, 1, 0]);
        assert_eq!(frame.bytes[8..16], [2, 0, 0, 0, 7, 0, 0, 0]);
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
