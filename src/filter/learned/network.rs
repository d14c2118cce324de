//! The network that predicts the filter's kernels: a small U-Net (Ronneberger et al. 2015) at half the image's resolution,
//! where 2×2 pixels are planes of one. `training/model.py` has the same in Python.

use rayon::prelude::*;

use super::affinity::{self, DILATIONS, PLANES_PER_LEVEL};
use super::block_convolution::BlockConvolution;
use super::convolution::{Convolution, MARGIN};
use super::input_statistics::INPUTS;
use super::weight_file::{WeightFile, WeightFileError};
use crate::filter::common::interleaved_planes::{InterleavedPlanes, extend};
use crate::filter::whole_image::WholeImage;

/// Predicted planes of the mixture.
pub const MIXTURE: usize = 6;

/// Predicted planes: those of the levels' kernels, then those of the mixture.
const OUTPUTS: usize = DILATIONS.len() * PLANES_PER_LEVEL + MIXTURE;

/// Distance in pixels from which inputs can change a prediction. On the way from the last layer's row to the inputs each layer reads a row
/// further, and a block of rows up to three more, since rounding depends on all of a block: 1 on the level of 2 pixels, then 4 on that of 4,
/// 3 on those of 8 and 16, 8, 17, 20 and 41 rows in all.
pub const REACH: usize = 82;

/// The layers, from fine to coarse and back. Parts of an image begin with whole blocks of rows on the two finest levels, which take most of
/// the time.
pub struct Network {
    enter: BlockConvolution,
    down1: [BlockConvolution; 2],
    down2: [Convolution; 2],
    down3: Convolution,
    up2: Convolution,
    up1: BlockConvolution,
    up0: BlockConvolution,
    /// The last layer in parts: the kernels of each level, and the mixture.
    leave: Vec<Convolution>,
}

impl Network {
    /// Reads weights.
    ///
    /// # Errors
    /// If the bytes are no weights of this network.
    pub fn new(bytes: &[u8]) -> Result<Self, WeightFileError> {
        let weights = WeightFile::new(bytes)?;
        let layer = |name, inputs, outputs| weights.layer(name, inputs, outputs);
        let block_layer = |name, inputs, outputs| weights.block_layer(name, inputs, outputs);
        let leave = weights.tensors("leave", 1, 48, 4 * OUTPUTS)?;
        let planes = (0..OUTPUTS).collect::<Vec<usize>>();
        let leave = planes.chunks(PLANES_PER_LEVEL).map(|planes| {
            let of_pixel = |pixel: usize| planes.iter().map(move |plane| pixel * OUTPUTS + plane);
            leave.select(&(0..4).flat_map(of_pixel).collect::<Vec<_>>())
        });
        Ok(Self {
            enter: block_layer("enter", 4 * INPUTS, 48)?,
            down1: [block_layer("down1a", 48, 64)?, block_layer("down1b", 64, 64)?],
            down2: [layer("down2a", 64, 96)?, layer("down2b", 96, 96)?],
            down3: layer("down3", 96, 96)?,
            up2: layer("up2", 96 + 96, 96)?,
            up1: block_layer("up1", 96 + 64, 48)?,
            up0: block_layer("up0", 48 + 48, 48)?,
            leave: leave.collect(),
        })
    }

    /// Predicts the filter of an image of `width`×`height` pixels. `inputs` are those of `InputStatistics::inputs`.
    pub fn predict(&self, inputs: InterleavedPlanes, width: usize, height: usize) -> Prediction<'_> {
        // Down
        let fine = self.enter.activate(&inputs);
        // Planes are freed as soon as they are read: here the filter takes most memory
        drop(inputs);
        let [a, b] = &self.down1;
        let middle = b.activate(&a.activate(&shrink(&fine)));
        let [a, b] = &self.down2;
        let coarse = b.activate(&a.activate(&shrink(&middle)));
        let coarsest = self.down3.activate(&shrink(&coarse));

        // Up, each level beside what it was made of
        let grown = |x: InterleavedPlanes, skipped: InterleavedPlanes| grow_beside(&x, &skipped);
        let coarse = self.up2.activate(&grown(coarsest, coarse));
        let middle = self.up1.activate(&grown(coarse, middle));
        let last = self.up0.activate(&grown(middle, fine));
        Prediction { network: self, last, width, height }
    }
}

/// The predicted filter of an image. Its planes are computed when they are asked for: all together they would take 280 bytes
/// a pixel.
pub struct Prediction<'a> {
    network: &'a Network,
    /// What the last layer reads.
    last: InterleavedPlanes,
    width: usize,
    height: usize,
}

impl Prediction<'_> {
    /// Takes the values of the margin from the parts there.
    pub fn complete_margin(&mut self, whole: &dyn WholeImage) {
        whole.complete_margin(&mut self.last, 2);
    }

    /// Computes the planes of a level's kernels, see `affinity`. Margins have the values of the nearest pixel.
    pub fn kernels(&self, level: usize, out: &mut InterleavedPlanes) {
        self.leave(&self.network.leave[level], out);
    }

    /// Returns the planes of the mixture, see `mixture`.
    pub fn mixture(&self) -> InterleavedPlanes {
        let mut out = InterleavedPlanes::new(self.width, self.height, MIXTURE, affinity::MARGIN, 0.0);
        self.leave(&self.network.leave[DILATIONS.len()], &mut out);
        out
    }

    /// Computes a part of the last layer and takes four planes of one pixel to 2×2 pixels.
    fn leave(&self, layer: &Convolution, out: &mut InterleavedPlanes) {
        let (x, width) = (&self.last, self.width);
        let (planes, stride, row_len) = (out.count(), out.stride(), out.row_len());
        let make_row = || vec![0.0; layer.outputs() * x.stride()];
        out.data_mut().par_chunks_mut(2 * row_len).enumerate().for_each_init(make_row, |row, (y, out)| {
            layer.convolve_row(x, y, row);
            for (iy, out) in out.chunks_exact_mut(row_len).enumerate() {
                for (plane, out) in out.chunks_exact_mut(stride).enumerate() {
                    let source = |ix: usize| &row[((2 * iy + ix) * planes + plane) * x.stride() + MARGIN..];
                    let (pairs, last) = out[affinity::MARGIN..][..width].as_chunks_mut();
                    for (pair, (&even, &odd)) in pairs.iter_mut().zip(source(0).iter().zip(source(1))) {
                        *pair = [even, odd];
                    }
                    last.fill(source(0)[width / 2]);
                    extend(out, affinity::MARGIN, width);
                }
            }
        });
    }
}

/// Means of 2×2 pixels.
fn shrink(x: &InterleavedPlanes) -> InterleavedPlanes {
    let (width, height) = (x.width() / 2, x.height() / 2);
    let mut out = InterleavedPlanes::new(width, height, x.count(), MARGIN, 0.0);
    let (stride, row_len) = (out.stride(), out.row_len());
    out.data_mut().par_chunks_mut(row_len).enumerate().for_each(|(y, out)| {
        for (plane, out) in out.chunks_exact_mut(stride).enumerate() {
            let [a, b] = [0, 1].map(|iy| x.row(plane, 2 * y + iy).chunks_exact(2));
            for (out, (a, b)) in out[MARGIN..][..width].iter_mut().zip(a.zip(b)) {
                *out = 0.25 * (a[0] + a[1] + b[0] + b[1]);
            }
        }
    });
    out
}

/// The planes of an image of half the size, each pixel repeated, and after them those of another.
fn grow_beside(small: &InterleavedPlanes, skipped: &InterleavedPlanes) -> InterleavedPlanes {
    let (width, height) = (skipped.width(), skipped.height());
    let mut out = InterleavedPlanes::new(width, height, small.count() + skipped.count(), MARGIN, 0.0);
    let (stride, row_len) = (out.stride(), out.row_len());
    out.data_mut().par_chunks_mut(row_len).enumerate().for_each(|(y, out)| {
        let (grown, copied) = out.split_at_mut(small.count() * stride);
        for (plane, out) in grown.chunks_exact_mut(stride).enumerate() {
            let (pairs, _) = out[MARGIN..][..width].as_chunks_mut();
            pairs.iter_mut().zip(small.row(plane, y / 2)).for_each(|(pair, &v)| *pair = [v; 2]);
        }
        for (plane, out) in copied.chunks_exact_mut(stride).enumerate() {
            out[MARGIN..][..width].copy_from_slice(skipped.row(plane, y));
        }
    });
    out
}
