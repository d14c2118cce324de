//! How much each colour and feature counts in the filter (paper, section 4.2): by how far it
//! depends on random parameters, as measured by mutual information over the samples of a cluster.

use std::ops::Range;

use rand::Rng;
use rand_pcg::Pcg32;

use super::bilateral::CONSTANT;
use super::mutual_information::{BitSlices, LANES, NO_SAMPLE, Standard, WORD};
use super::neighbourhood::{Guide, Neighbourhood};
use super::prpf::PrpfSettings;
use crate::stats::{Layout, Part, Store};

/// Bits by which each pair of variables seems to depend at least: no 0/0 where nothing depends on
/// anything, and the share of random pairs is the answer then.
const LEAST_INFORMATION: f32 = 1e-4;

/// Fewer samples than this say nothing on dependence.
const FEWEST_SAMPLES: usize = 32;

/// Mean and one over the deviation of numbers uniform in [0, 1).
const UNIFORM: (f32, f32) = (0.5, 3.464_101_6);

/// Variance of a position uniform in its pixel.
const IN_PIXEL: f32 = 1.0 / 12.0;

/// What the weights of one pass are computed from.
pub(super) struct Evidence<'a> {
    pub store: &'a Store,
    pub guide: &'a Guide,
    pub neighbourhood: &'a Neighbourhood,
    /// What the store's colours were multiplied by in the guide.
    pub exposure: f32,
    pub settings: &'a PrpfSettings,
    pub pass: usize,
    pub window: usize,
    pub seed: u64,
}

/// The sample vector's dimensions in the order in which information is measured: each group depends
/// on those before it.
pub(super) struct Variables {
    /// Layout indices.
    pub dims: Vec<usize>,
    pub randoms: Range<usize>,
    pub positions: Range<usize>,
    pub features: Range<usize>,
    pub colours: Range<usize>,
}

/// How strongly randomness counts against a dimension in one pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Damping {
    pub colours: f32,
    pub features: f32,
}

impl Variables {
    pub fn new(layout: &Layout, features: &[usize]) -> Self {
        let mut dims = layout.randoms();
        let randoms = 0..dims.len();
        dims.extend(layout.film());
        let positions = randoms.end..dims.len();
        dims.extend(features);
        let features = positions.end..dims.len();
        dims.extend(layout.radiance());
        let colours = features.end..dims.len();
        Self { dims, randoms, positions, features, colours }
    }

    /// W^r: the share of the random parameters in what a variable depends on, of the information
    /// that it has in common with each variable.
    fn randomness(&self, information: &[f32; LANES]) -> f32 {
        let total = |group: &Range<usize>| {
            information[group.clone()].iter().sum::<f32>() + LEAST_INFORMATION * group.len() as f32
        };
        let random = total(&self.randoms);
        random / (random + total(&self.positions))
    }

    /// From samples to weights: β of each feature, α of each colour, and W_c^r.
    pub fn weigh(&self, slices: &BitSlices, samples: usize, damping: Damping, weights: &mut [f32]) {
        let (beta, rest) = weights.split_at_mut(self.features.len());
        let (alpha, colour_randomness) = rest.split_at_mut(self.colours.len());
        if samples < FEWEST_SAMPLES {
            alpha.fill(0.0);
            beta.fill(1.0 / self.features.len() as f32);
            colour_randomness[0] = self.randomness(&[0.0; LANES]);
            return;
        }

        // D_c^r + D_c^p + D_c^f, and D_c^{f,l} by feature.
        let mut on_all = 0.0;
        let mut on_feature = [0.0; LANES];
        colour_randomness[0] = 0.0;
        for (k, alpha) in self.colours.clone().zip(&mut *alpha) {
            let information = slices.information(k, self.features.end);
            let randomness = self.randomness(&information);
            *alpha = (1.0 - damping.colours * randomness).max(0.0);
            colour_randomness[0] += randomness / self.colours.len() as f32;
            on_all += information[..self.features.end].iter().sum::<f32>();
            let on_features = &information[self.features.clone()];
            on_feature.iter_mut().zip(on_features).for_each(|(sum, bits)| *sum += bits);
        }
        for ((k, beta), on_feature) in self.features.clone().zip(beta).zip(on_feature) {
            let randomness = self.randomness(&slices.information(k, self.positions.end));
            let share = on_feature / (on_all + f32::MIN_POSITIVE);
            *beta = share * (1.0 - damping.features * randomness).max(0.0);
        }
    }
}

/// Names of what [`Variables::weigh`] writes.
pub(super) fn names(layout: &Layout) -> Vec<String> {
    let name = |(dim, _): (usize, _)| format!("beta {}", layout.dimensions()[dim].name);
    let others = ["alpha R", "alpha G", "alpha B", "randomness"].map(str::to_owned);
    layout.features().into_iter().map(name).chain(others).collect()
}

/// What evaluations of one pass share.
pub(super) struct Scratch<'a> {
    variables: Variables,
    cluster: Vec<(u32, u32)>,
    samples: Vec<&'a [f32]>,
    slices: BitSlices,
    block: Box<[[f32; LANES]; WORD]>,
}

impl<'a> Scratch<'a> {
    pub fn new(evidence: &Evidence<'a>) -> Self {
        Self {
            variables: Variables::new(evidence.store.layout(), evidence.guide.feature_dims()),
            cluster: Vec::new(),
            samples: Vec::new(),
            slices: BitSlices::default(),
            block: Box::new([[NO_SAMPLE; LANES]; WORD]),
        }
    }
}

impl<'a> Evidence<'a> {
    /// Numbers that [`Self::evaluate`] writes: β of each feature, α of three colours, and the
    /// share of randomness in the colour, W_c^r.
    pub fn len(&self) -> usize {
        self.guide.features() + 4
    }

    /// Computes the weights at a pixel.
    pub fn evaluate(&self, (x, y): (usize, usize), scratch: &mut Scratch<'a>, weights: &mut [f32]) {
        self.guide.cluster(x, y, self.window, &mut scratch.cluster);
        let standard = self.standard((x, y), scratch);
        let samples = self.gather((x, y), &standard, scratch);
        let growth = 1.0 + self.settings.randomness_growth * self.pass as f32;
        let damping = Damping { colours: self.settings.colour_damping * growth, features: growth };
        scratch.variables.weigh(&scratch.slices, samples, damping, weights);
    }

    /// Mean and deviation of each dimension of the sample vector over the cluster.
    fn standard(&self, (x, y): (usize, usize), scratch: &Scratch) -> Standard {
        let Scratch { variables, cluster, .. } = scratch;
        let mut standard = Standard { mean: [0.0; LANES], scale: [0.0; LANES] };
        for &dim in &variables.dims[variables.randoms.clone()] {
            (standard.mean[dim], standard.scale[dim]) = UNIFORM;
        }

        let n = cluster.len().max(1) as f32;
        let offset = |(xj, yj): (u32, u32)| [xj as f32 - x as f32, yj as f32 - y as f32];
        let mut sums = [0.0; 2];
        let mut squares = [0.0; 2];
        for d in cluster.iter().map(|&j| offset(j)) {
            for axis in 0..2 {
                sums[axis] += d[axis];
                squares[axis] += d[axis] * d[axis];
            }
        }
        for (axis, &dim) in variables.dims[variables.positions.clone()].iter().enumerate() {
            let own = self.store.rows()[y].moments(x, dim, Part::Whole).mean as f32;
            let shift = sums[axis] / n;
            standard.mean[dim] = own + shift;
            standard.scale[dim] = 1.0 / (squares[axis] / n - shift * shift + IN_PIXEL).sqrt();
        }

        let features = variables.dims[variables.features.clone()].iter().map(|&dim| (dim, 1.0));
        let colours = variables.dims[variables.colours.clone()].iter().map(|&dim| (dim, self.exposure));
        for (k, (dim, exposure)) in features.chain(colours).enumerate() {
            let mean = self.neighbourhood.mean(k, x, y);
            let deviation = self.neighbourhood.variance(k, x, y).sqrt();
            standard.mean[dim] = mean / exposure;
            if deviation > CONSTANT * mean.abs().max(1.0) {
                standard.scale[dim] = exposure / deviation;
            }
        }
        standard
    }

    /// Makes bits of the samples of the cluster. Returns their number.
    fn gather(&self, i: (usize, usize), standard: &Standard, scratch: &mut Scratch<'a>) -> usize {
        self.choose(i, scratch);
        // Apart from the choice, so that many samples are on their way from memory at once.
        let Scratch { variables, samples, slices, block, .. } = scratch;
        slices.clear();
        for samples in samples.chunks(WORD) {
            samples.iter().zip(&mut **block).for_each(|(sample, to)| copy(sample, to));
            block[samples.len()..].fill([NO_SAMPLE; LANES]);
            slices.push(block, samples.len(), standard, &variables.dims);
        }
        samples.len()
    }

    /// Lists the pixel's own kept samples and as many of the rest of the cluster's as are wanted,
    /// every pixel of it with the same chance.
    fn choose(&self, i: (usize, usize), scratch: &mut Scratch<'a>) {
        let Scratch { cluster, samples, .. } = scratch;
        samples.clear();
        let store = self.store;
        let dims = store.layout().len();
        let samples_of = |(x, y): (usize, usize)| store.rows()[y].reservoir(x).chunks_exact(dims);
        let at = |p: usize| (cluster[p].0 as usize, cluster[p].1 as usize);
        let wanted = if store.capacity() > 0 { self.settings.mi_samples } else { 0 };
        samples.extend(samples_of(i).take(wanted));
        let others = wanted - samples.len();
        let available = || (0..cluster.len()).map(|p| samples_of(at(p)).len()).sum::<usize>();
        if cluster.len() <= wanted && available() <= wanted {
            samples.extend((0..cluster.len()).map(at).filter(|&j| j != i).flat_map(samples_of));
            return;
        }
        // One pixel from each of `others` equal parts of the cluster.
        let pixel = (i.1 * store.width() + i.0) as u64;
        let mut rng = Pcg32::new(self.seed ^ pixel, self.pass as u64);
        let part = cluster.len() as f64 / others as f64;
        let (mut last, mut again) = (usize::MAX, 0);
        for s in 0..others {
            let jitter = f64::from(rng.next_u32()) / (f64::from(u32::MAX) + 1.0);
            let p = ((s as f64 + jitter) * part) as usize;
            let p = if at(p) == i { (p + 1) % cluster.len() } else { p };
            // Neighbouring parts may give the same pixel, and then its next sample.
            again = if p == last { again + 1 } else { 0 };
            last = p;
            let (x, y) = at(p);
            let row = &store.rows()[y];
            let slot = (self.first_slot((x, y)) + again) % row.kept(x) as u32;
            samples.push(&row.reservoir(x)[slot as usize * dims..][..dims]);
        }
    }

    /// Which of a pixel's kept samples is taken first: any, but the same for all evaluations of a pass, so that
    /// what neighbouring evaluations look at stays in the cache.
    fn first_slot(&self, (x, y): (usize, usize)) -> u32 {
        /// 2³² over the golden ratio: scatters neighbouring numbers (Knuth, vol. 3, section 6.4).
        const SCATTER: u32 = 0x9E37_79B9;
        let pixel = (y * self.store.width() + x) as u32;
        ((pixel ^ self.seed as u32).wrapping_mul(SCATTER) >> 16) + self.pass as u32
    }
}

/// Copies a sample vector to the first places. In pieces of a fixed size, which costs a third of a
/// copy of any size; the last may overlap.
#[inline(always)]
pub(super) fn copy(sample: &[f32], to: &mut [f32; LANES]) {
    const PIECE: usize = 8;
    // What is longer ends in auxiliary dimensions that no weight is made from.
    let n = sample.len().min(LANES);
    if n < PIECE {
        to[..n].copy_from_slice(sample);
        return;
    }
    for start in (0..n).step_by(PIECE) {
        let start = start.min(n - PIECE);
        let piece: &[f32; PIECE] = sample[start..start + PIECE].try_into().expect("it has this length");
        to[start..start + PIECE].copy_from_slice(piece);
    }
}

#[cfg(test)]
mod tests;
