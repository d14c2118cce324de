//! Computes the network's inputs: statistics of each pixel's samples, invariant to the scene's brightness and size.

use rayon::prelude::*;

use super::convolution::MARGIN;
use crate::filter::common::fireflies::FireflyClamp;
use crate::filter::common::half_counts::HalfCounts;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::filter::whole_image::{self, WholeImage};
use crate::image::{Planes, luminance};
use crate::stats::{Block, Part, Store};

/// Numbers per pixel that the network gets.
pub const INPUTS: usize = 25;

/// Width and height that the network works on are multiples of this: it halves the resolution three times after the
/// input's.
pub const ALIGNMENT: usize = 16;

/// Smallest and largest albedo that colours are divided by.
pub const ALBEDO_RANGE: [f32; 2] = [0.02, 64.0];

// As in `network_inputs` of `training/model.py`: other values need other weights.
/// Factor on ratios of radiance before their logarithm.
const LOG_GAIN: f32 = 10.0;
/// Least brightness that a pixel's noise is relative to, in units of the image's.
const LEVEL_FLOOR: f32 = 0.01;
/// Binary logarithm of the sample count that is an input of 1.
const LOG_COUNT_UNIT: f32 = 6.0;

/// Greatest magnitude of an input.
const MAX_INPUT: f32 = 64.0;

/// Luminances above this many times their median count as much when the unit of radiance is determined.
const MAX_LUMINANCE: f32 = 8.0;

/// The statistics that the network reads. Deviations are those of the samples.
pub struct InputStatistics {
    /// Factor from radiance to units of the image's brightness.
    pub scale: f32,
    /// Without directly visible emission: 3 planes.
    pub colour: Planes,
    /// Deviation of the luminance.
    pub deviation: Vec<f32>,
    /// Difference of the luminances of the halves, of which one without samples counts as black.
    pub difference: Vec<f32>,
    /// Directly visible emission: 3 planes.
    pub emission: Planes,
    pub albedo: FeatureMoments,
    pub normal: FeatureMoments,
    /// Normal of the second hit: 3 planes.
    pub second_normal: Planes,
    /// In units of its mean over the image.
    pub position_deviation: Vec<f32>,
    /// Fraction of the samples that hit a surface: 1 plane.
    pub hit: Planes,
    pub count: Vec<f32>,
}

/// Mean of a feature, 3 planes, and its deviation, mean of the axes.
pub struct FeatureMoments {
    pub mean: Planes,
    pub deviation: Vec<f32>,
}

impl InputStatistics {
    /// Reads the statistics of a store, its colours with clamped fireflies. Blocks that its layout lacks have the values of
    /// a white surface that does not vary.
    pub fn from_store(
        store: &Store,
        counts: &HalfCounts,
        clamped: &FireflyClamp,
        whole: &dyn WholeImage,
    ) -> Self {
        // Read blocks of dimensions, with values for those that are missing
        let layout = store.layout();
        let constant = |value: f32, planes| {
            let mut constant = Planes::new(store.width(), store.height(), planes);
            constant.data_mut().fill(value);
            constant
        };
        let feature = |block, missing| match layout.block(block) {
            Some(dims) => {
                let (halves, variance) = store.halves(dims);
                let deviation = per_pixel(&variance, |v| (v[0].sqrt() + v[1].sqrt() + v[2].sqrt()) / 3.0);
                FeatureMoments { mean: filled_mean(counts, halves), deviation }
            }
            None => FeatureMoments { mean: constant(missing, 3), deviation: vec![0.0; store.pixels()] },
        };
        let mean = |block, missing, planes| match layout.block(block) {
            Some(dims) => {
                let halves = [0, 1].map(|half| store.means(Part::Half(half), dims.clone()));
                filled_mean(counts, halves)
            }
            None => constant(missing, planes),
        };

        // Compute the statistics of the clamped colour
        let variance = store.variances(Part::Whole, layout.colour());
        let mut deviation = per_pixel(&variance, |v| luminance(v.map(f32::sqrt)));
        clamped.fireflies.iter().for_each(|firefly| deviation[firefly.pixel] *= firefly.scale);
        let [a, b] = clamped.halves.each_ref().map(|half| per_pixel(half, luminance));
        let difference = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let colour = filled_mean(counts, clamped.halves.clone());

        // Read the features
        let position = plane_of(&colour, feature(Block::Position1, 0.0).deviation);
        Self {
            scale: 1.0 / brightness(&plane_of(&colour, per_pixel(&colour, luminance)), whole),
            colour,
            deviation,
            difference,
            emission: mean(Block::Emission, 0.0, 3),
            albedo: feature(Block::Albedo, 1.0),
            normal: feature(Block::Normal1, 0.0),
            second_normal: mean(Block::Normal2, 0.0, 3),
            position_deviation: in_units_of_the_mean(position, whole),
            hit: mean(Block::Hit, 1.0, 1),
            count: store.count_plane().plane(0).to_vec(),
        }
    }

    /// Returns the inputs of the network: planes at half the resolution, of the even and the odd rows' even and odd pixels.
    /// The image is extended to a size that the network can halve. `nlm` is the image of that denoiser without
    /// directly visible emission, in the unit of the colour: 3 planes.
    pub fn inputs(&self, nlm: &Planes) -> InterleavedPlanes {
        let (width, height) = (self.colour.width(), self.colour.height());
        let [half_width, half_height] = [width, height].map(|size| size.next_multiple_of(ALIGNMENT) / 2);
        let mut inputs = InterleavedPlanes::new(half_width, half_height, 4 * INPUTS, MARGIN, 0.0);
        let (stride, row_len) = (inputs.stride(), inputs.row_len());
        inputs.data_mut().par_chunks_mut(row_len).enumerate().for_each(|(y, row)| {
            for (part, out) in row.chunks_exact_mut(INPUTS * stride).enumerate() {
                let y = (2 * y + part / 2).min(height - 1);
                // A block of pixels at a time, so that its values are written plane by plane
                for x in (0..half_width).step_by(ALIGNMENT / 2) {
                    let pixel = |k: usize| y * width + (2 * (x + k) + part % 2).min(width - 1);
                    let block: [_; ALIGNMENT / 2] = std::array::from_fn(|k| self.at(pixel(k), nlm));
                    for (plane, out) in out.chunks_exact_mut(stride).enumerate() {
                        // The largest accepted values have ratios that are no numbers.
                        let bounded = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(-MAX_INPUT, MAX_INPUT) };
                        let out = &mut out[MARGIN + x..][..ALIGNMENT / 2];
                        out.iter_mut().zip(&block).for_each(|(out, inputs)| *out = bounded(inputs[plane]));
                    }
                }
            }
        });
        inputs
    }

    /// Returns a pixel's inputs, numbers near 1.
    fn at(&self, i: usize, nlm: &Planes) -> [f32; INPUTS] {
        // Compute radiance relative to albedo and brightness, in logarithms
        let rgb = |planes: &Planes| [0, 1, 2].map(|c| planes.plane(c)[i]);
        let log = |v: f32| (1.0 + v).min(f32::MAX).ln();
        let albedo = rgb(&self.albedo.mean);
        let demodulated = |planes: &Planes| {
            let colour = rgb(planes);
            [0, 1, 2]
                .map(|c| log(LOG_GAIN * self.scale * colour[c].max(0.0) / albedo[c].max(ALBEDO_RANGE[0])))
        };
        let level = self.scale * luminance(rgb(&self.colour));
        let relative = |v: f32| log(LOG_GAIN / (level + LEVEL_FLOOR) * (self.scale * v));
        let count = self.count[i].max(1.0);
        let [[c0, c1, c2], [m0, m1, m2]] = [demodulated(&self.colour), demodulated(nlm)];
        let ([n0, n1, n2], [s0, s1, s2]) = (rgb(&self.normal.mean), rgb(&self.second_normal));

        // List the inputs in the order of the training program
        [
            c0,
            c1,
            c2,
            log(LOG_GAIN * level),
            relative(self.deviation[i] / count.sqrt()),
            relative(self.difference[i].abs()),
            albedo[0],
            albedo[1],
            albedo[2],
            self.albedo.deviation[i],
            n0,
            n1,
            n2,
            self.normal.deviation[i],
            s0,
            s1,
            s2,
            log(self.position_deviation[i]),
            self.hit.plane(0)[i],
            log(self.scale * luminance(rgb(&self.emission))),
            count.log2() / LOG_COUNT_UNIT,
            m0,
            m1,
            m2,
            // Whether there is an image of `nlm`: in training it sometimes was missing
            1.0,
        ]
    }
}

/// Mean of the halves, where pixels without samples have the values of their neighbours.
fn filled_mean(counts: &HalfCounts, mut halves: [Planes; 2]) -> Planes {
    counts.fill_missing(&mut halves);
    counts.mean([&halves[0], &halves[1]])
}

/// Computes a value from the three planes of each pixel.
fn per_pixel(planes: &Planes, of: impl Fn([f32; 3]) -> f32 + Sync) -> Vec<f32> {
    let [r, g, b] = [0, 1, 2].map(|c| planes.plane(c));
    (0..planes.pixels()).into_par_iter().map(|i| of([r[i], g[i], b[i]])).collect()
}

/// Returns one plane of the size of others.
fn plane_of(size: &Planes, values: Vec<f32>) -> Planes {
    let mut plane = Planes::new(size.width(), size.height(), 1);
    plane.data_mut().copy_from_slice(&values);
    plane
}

/// The unit of radiance: the mean luminance, where high ones are clamped. Pixels without light do not count for the median.
fn brightness(luminances: &Planes, whole: &dyn WholeImage) -> f32 {
    let Some(median) = whole_image::median_of_positive(whole, luminances) else { return 1.0 };
    let max = MAX_LUMINANCE * median;
    (whole_image::mean(whole, luminances, |v| v.min(max)) as f32).max(f32::MIN_POSITIVE)
}

fn in_units_of_the_mean(values: Planes, whole: &dyn WholeImage) -> Vec<f32> {
    let mean = whole_image::mean(whole, &values, |v| v);
    let mut values = values.into_data();
    if mean > 0.0 {
        values.iter_mut().for_each(|v| *v = (f64::from(*v) / mean) as f32);
    }
    values
}
