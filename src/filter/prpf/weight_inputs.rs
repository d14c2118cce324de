//! Weights of colours and features at one pixel (paper, section 4.2): selects samples of the pixel's cluster,
//! standardises them by the neighbourhood's statistics, and computes α, β and W_c^r from their mutual information.

use rand::Rng;
use rand_pcg::Pcg32;

use super::bit_slices::{BLOCK_SAMPLES, BinLimits, BitSlices, Standardisation};
use super::feature_guide::FeatureGuide;
use super::inverse_bandwidths::ROUNDING;
use super::neighbourhood::Neighbourhood;
use super::reservoirs::Reservoirs;
use super::sample_vector::MAX_VARIABLES;
use super::settings::PrpfSettings;
use super::variables::{Damping, Variables};
use crate::simd::{apply, multiversioned, prefetch};
use crate::stats::{Part, Store};

/// Mean and inverse standard deviation of numbers that are uniform in [0, 1).
const UNIFORM: (f32, f32) = (0.5, 3.464_101_6);

/// Variance of positions that are uniform within a pixel.
const PIXEL_VARIANCE: f32 = 1.0 / 12.0;

/// Inputs of the weights of one pass.
pub struct WeightInputs<'a> {
    pub store: &'a Store,
    pub reservoirs: &'a Reservoirs<'a>,
    pub guide: &'a FeatureGuide,
    pub neighbourhood: &'a Neighbourhood,
    /// Factor by which colours were multiplied in guide and neighbourhood.
    pub normalisation_scale: f32,
    pub settings: &'a PrpfSettings,
    pub pass: usize,
    pub window: usize,
    pub seed: u64,
}

/// Memory that evaluations of one pass reuse.
pub struct Scratch<'a> {
    variables: Variables,
    cluster: Vec<(u32, u32)>,
    samples: Vec<&'a [f32]>,
    slices: BitSlices,
}

impl<'a> Scratch<'a> {
    pub fn new(inputs: &WeightInputs<'a>) -> Self {
        Self {
            variables: Variables::new(inputs.store.layout(), inputs.guide.feature_dims()),
            cluster: Vec::new(),
            samples: Vec::new(),
            slices: BitSlices::default(),
        }
    }
}

impl<'a> WeightInputs<'a> {
    /// Number of values that [`Self::evaluate`] writes: β of each feature, α of three colours, and W_c^r.
    pub fn len(&self) -> usize {
        self.guide.features() + 4
    }

    /// Writes the weights of a pixel.
    pub fn evaluate(&self, (x, y): (usize, usize), scratch: &mut Scratch<'a>, weights: &mut [f32]) {
        self.guide.cluster(x, y, self.window, &mut scratch.cluster);
        let standardisation = self.standardisation((x, y), scratch);
        let samples = self.slice_samples((x, y), &standardisation, scratch);
        let growth = 1.0 + self.settings.randomness_growth * self.pass as f32;
        let damping = Damping { colours: self.settings.colour_damping * growth, features: growth };
        scratch.variables.weigh(&scratch.slices, samples, damping, weights);
    }

    /// Computes mean and inverse standard deviation of each dimension of the sample vector over the cluster.
    fn standardisation(&self, (x, y): (usize, usize), scratch: &Scratch) -> Standardisation {
        let Scratch { variables, cluster, .. } = scratch;
        let mut standardisation = Standardisation { mean: [0.0; MAX_VARIABLES], scale: [0.0; MAX_VARIABLES] };

        // Random parameters are uniform
        for &dim in &variables.dims[variables.randoms.clone()] {
            (standardisation.mean[dim], standardisation.scale[dim]) = UNIFORM;
        }

        // Positions: sum over the cluster, relative to the pixel
        let n = cluster.len().max(1) as f32;
        let [sums, squares] = position_sums(cluster, (x as i32, y as i32)).map(|sums| sums.map(|s| s as f32));
        for (axis, &dim) in variables.dims[variables.positions.clone()].iter().enumerate() {
            let own = self.store.rows()[y].moments(x, dim, Part::Whole).mean as f32;
            let shift = sums[axis] / n;
            standardisation.mean[dim] = own + shift;
            standardisation.scale[dim] = 1.0 / (squares[axis] / n - shift * shift + PIXEL_VARIANCE).sqrt();
        }

        // Features and colours: take the neighbourhood's statistics
        let features = variables.dims[variables.features.clone()].iter().map(|&dim| (dim, 1.0));
        let colours =
            variables.dims[variables.colours.clone()].iter().map(|&dim| (dim, self.normalisation_scale));
        for (k, (dim, scale)) in features.chain(colours).enumerate() {
            let mean = self.neighbourhood.mean(k, x, y);
            let deviation = self.neighbourhood.variance(k, x, y).sqrt();
            standardisation.mean[dim] = mean / scale;
            if deviation > ROUNDING * mean.abs().max(1.0) {
                standardisation.scale[dim] = scale / deviation;
            }
        }
        standardisation
    }

    /// Selects and bit-slices samples of the cluster. Returns their number.
    fn slice_samples(
        &self,
        i: (usize, usize),
        standardisation: &Standardisation,
        scratch: &mut Scratch<'a>,
    ) -> usize {
        /// Numbers in a line of the cache.
        const FLOATS_PER_LINE: usize = 16;
        self.select_samples(i, scratch);
        let Scratch { variables, samples, slices, .. } = scratch;
        let limits = BinLimits::new(standardisation);
        slices.clear();
        for (index, block) in samples.chunks(BLOCK_SAMPLES).enumerate() {
            // Samples lie scattered over the reservoirs: those of the next block are loaded during the work on this one.
            let next = samples.iter().skip((index + 1) * BLOCK_SAMPLES).take(BLOCK_SAMPLES);
            next.for_each(|sample| {
                (0..sample.len()).step_by(FLOATS_PER_LINE).for_each(|i| prefetch(sample, i))
            });
            slices.push(block, &limits, &variables.dims);
        }
        slices.finish();
        samples.len()
    }

    /// Selects the samples in the pixel's reservoir and, up to `mi_samples` in all, samples in the reservoirs
    /// of the rest of the cluster, every pixel of it with equal probability.
    fn select_samples(&self, i: (usize, usize), scratch: &mut Scratch<'a>) {
        let Scratch { cluster, samples, .. } = scratch;
        samples.clear();
        let (store, reservoirs) = (self.store, self.reservoirs);
        let own = reservoirs.pixel((i.0 as u32, i.1 as u32));
        let at = |p: usize| reservoirs.pixel(cluster[p]);

        // Select all samples if there are at most as many as wanted
        let wanted = if store.capacity() > 0 { self.settings.mi_samples } else { 0 };
        samples.extend(reservoirs.samples(own).take(wanted));
        let others = wanted - samples.len();
        let available = || (0..cluster.len()).map(|p| reservoirs.count(at(p)) as usize).sum::<usize>();
        if cluster.len() <= wanted && available() <= wanted {
            let rest = (0..cluster.len()).map(at).filter(|&j| j != own);
            rest.for_each(|j| samples.extend(reservoirs.samples(j)));
            return;
        }

        // Otherwise select a pixel from each of `others` equal parts of the cluster, whose size is a fixed-point number
        let mut rng = Pcg32::new(self.seed ^ own as u64, self.pass as u64);
        let stratum = Stratum::new(cluster.len(), others);
        let (mut previous, mut repeats) = (usize::MAX, 0);
        for s in 0..others as u64 {
            let p = stratum.element(s, rng.next_u32());
            let j = at(p);
            let j = if j == own { at((p + 1) % cluster.len()) } else { j };
            // A pixel that is selected again contributes its next sample.
            repeats = if j == previous { repeats + 1 } else { 0 };
            previous = j;
            samples.push(reservoirs.sample(j, self.first_sample(j) + repeats));
        }
    }

    /// Returns a pseudo-random number that selects a pixel's first sample. It is the same in all evaluations
    /// of a pass, so that neighbouring evaluations read the same memory.
    fn first_sample(&self, pixel: usize) -> u32 {
        /// 2³² over the golden ratio: scatters neighbouring numbers (Knuth, vol. 3, section 6.4).
        const SCATTER: u32 = 0x9E37_79B9;
        ((pixel as u32 ^ self.seed as u32).wrapping_mul(SCATTER) >> 16) + self.pass as u32
    }
}

/// The size of one of several equal parts of a sequence: a fixed-point number.
struct Stratum(u64);

impl Stratum {
    const FRACTION_BITS: u32 = 32;

    /// One of `parts` parts of a sequence of `len` elements, fewer than 2³².
    fn new(len: usize, parts: usize) -> Self {
        Self(((len as u64) << Self::FRACTION_BITS) / parts.max(1) as u64)
    }

    /// Returns an element of the part of this index, each with equal probability if `random` is uniform.
    fn element(&self, index: u64, random: u32) -> usize {
        // Of a part of more than one element the product has more than 64 bits
        let jitter = ((u128::from(random) * u128::from(self.0)) >> Self::FRACTION_BITS) as u64;
        ((index * self.0 + jitter) >> Self::FRACTION_BITS) as usize
    }
}

/// Returns the sums and the sums of squares of the offsets of a cluster's pixels from a pixel, along both axes.
#[apply(multiversioned!)]
fn position_sums(cluster: &[(u32, u32)], (x, y): (i32, i32)) -> [[i64; 2]; 2] {
    let (mut sums, mut squares) = ([0; 2], [0; 2]);
    for &(xj, yj) in cluster {
        for (axis, d) in [xj as i32 - x, yj as i32 - y].into_iter().enumerate() {
            sums[axis] += i64::from(d);
            squares[axis] += i64::from(d * d);
        }
    }
    [sums, squares]
}

#[cfg(test)]
mod tests;
