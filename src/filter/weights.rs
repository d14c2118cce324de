//! How much each colour and feature counts in the filter (paper, section 4.2): by how far it
//! depends on random parameters, as measured by mutual information over the samples of a cluster.

use rand::Rng;
use rand_pcg::Pcg32;

use super::bilateral::CONSTANT;
use super::mutual_information::{BitSlices, LANES, NO_SAMPLE, Standard, WORD};
use super::neighbourhood::{Guide, Neighbourhood};
use super::prpf::PrpfSettings;
use crate::stats::{Part, Store};

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

/// Buffers that evaluations share.
pub(super) struct Scratch {
    cluster: Vec<(u32, u32)>,
    slices: BitSlices,
    block: Box<[[f32; LANES]; WORD]>,
    filled: usize,
}

impl Scratch {
    pub fn new(settings: &PrpfSettings) -> Self {
        Self {
            cluster: Vec::new(),
            slices: BitSlices::new(settings.mi_samples),
            block: Box::new([[NO_SAMPLE; LANES]; WORD]),
            filled: 0,
        }
    }
}

impl Evidence<'_> {
    /// Numbers that [`Self::evaluate`] writes: β of each feature, α of three colours, and the
    /// share of randomness in the colour, W_c^r.
    pub fn len(&self) -> usize {
        self.guide.features() + 4
    }

    /// Computes the weights at a pixel.
    pub fn evaluate(&self, (x, y): (usize, usize), scratch: &mut Scratch, weights: &mut [f32]) {
        self.guide.cluster(x, y, self.window, &mut scratch.cluster);
        let standard = self.standard((x, y), &scratch.cluster);
        let samples = self.gather((x, y), &standard, scratch);
        self.weigh(samples, &mut scratch.slices, weights);
    }

    /// Mean and deviation of each dimension of the sample vector over the cluster.
    fn standard(&self, (x, y): (usize, usize), cluster: &[(u32, u32)]) -> Standard {
        let layout = self.store.layout();
        let mut standard = Standard { mean: [0.0; LANES], scale: [0.0; LANES] };
        for dim in layout.randoms() {
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
        for (axis, dim) in layout.film().enumerate() {
            let own = self.store.rows()[y].moments(x, dim, Part::Whole).mean as f32;
            let shift = sums[axis] / n;
            standard.mean[dim] = own + shift;
            standard.scale[dim] = 1.0 / (squares[axis] / n - shift * shift + IN_PIXEL).sqrt();
        }

        let features = self.guide.feature_dims().iter().map(|&dim| (dim, 1.0));
        let colours = layout.radiance().map(|dim| (dim, self.exposure));
        for (k, (dim, exposure)) in features.chain(colours).enumerate() {
            let mean = self.neighbourhood.means.at(k, x, y);
            let deviation = self.neighbourhood.variances.at(k, x, y).sqrt();
            standard.mean[dim] = mean / exposure;
            if deviation > CONSTANT * mean.abs().max(1.0) {
                standard.scale[dim] = exposure / deviation;
            }
        }
        standard
    }

    /// Takes the pixel's own kept samples and as many of the rest of the cluster's as are wanted,
    /// every pixel of it with the same chance. Returns their number.
    fn gather(&self, i: (usize, usize), standard: &Standard, scratch: &mut Scratch) -> usize {
        let Scratch { cluster, slices, block, filled } = scratch;
        slices.clear();
        *filled = 0;
        let dims = self.store.layout().len();
        let mut taken = 0;
        let mut take = |sample: &[f32]| {
            block[*filled][..dims].copy_from_slice(sample);
            *filled += 1;
            taken += 1;
            if *filled == WORD {
                slices.push(block, WORD, standard);
                *filled = 0;
            }
        };

        let kept = |(x, y): (usize, usize)| self.store.rows()[y].reservoir(x);
        let at = |p: usize| (cluster[p].0 as usize, cluster[p].1 as usize);
        let wanted = self.settings.mi_samples;
        let own = kept(i);
        own.chunks_exact(dims).take(wanted).for_each(&mut take);
        let others = wanted.saturating_sub(own.len() / dims);
        let available = || (0..cluster.len()).map(|p| kept(at(p)).len() / dims).sum::<usize>();
        if cluster.len() <= wanted && available() <= wanted {
            for j in (0..cluster.len()).map(at).filter(|&j| j != i) {
                kept(j).chunks_exact(dims).for_each(&mut take);
            }
        } else {
            // One pixel from each of `others` equal parts of the cluster.
            let pixel = (i.1 * self.store.width() + i.0) as u64;
            let mut rng = Pcg32::new(self.seed ^ pixel, self.pass as u64);
            let part = cluster.len() as f64 / others as f64;
            for s in 0..others {
                let jitter = f64::from(rng.next_u32()) / (f64::from(u32::MAX) + 1.0);
                let p = ((s as f64 + jitter) * part) as usize;
                let p = if at(p) == i { (p + 1) % cluster.len() } else { p };
                let samples = kept(at(p));
                // Neighbouring parts may give the same pixel, and then its next sample.
                let slot = s % (samples.len() / dims);
                take(&samples[slot * dims..][..dims]);
            }
        }

        if *filled > 0 {
            block[*filled..].fill([NO_SAMPLE; LANES]);
            slices.push(block, *filled, standard);
        }
        taken
    }

    /// From samples to weights.
    fn weigh(&self, samples: usize, slices: &mut BitSlices, weights: &mut [f32]) {
        let layout = self.store.layout();
        let mut order = layout.randoms();
        let randoms = 0..order.len();
        order.extend(layout.film());
        let positions = randoms.end..order.len();
        order.extend(self.guide.feature_dims());
        let features = positions.end..order.len();
        order.extend(layout.radiance());
        let colours = features.end..order.len();

        let (beta, rest) = weights.split_at_mut(features.len());
        let (alpha, colour_randomness) = rest.split_at_mut(colours.len());
        let randomness = |on_random: f32, on_position: f32| {
            let [random, all] = [randoms.len(), positions.end].map(|n| n as f32 * LEAST_INFORMATION);
            (on_random + random) / (on_random + on_position + all)
        };
        if samples < FEWEST_SAMPLES {
            alpha.fill(0.0);
            beta.fill(1.0 / features.len() as f32);
            colour_randomness[0] = randomness(0.0, 0.0);
            return;
        }
        slices.reorder(&order);

        let growth = 1.0 + self.settings.randomness_growth * self.pass as f32;
        let sum = |bits: &[f32]| bits.iter().sum::<f32>();
        // D_c^r, D_c^p and D_c^f, then D_c^{f,l} by feature.
        let mut on_all = 0.0;
        let mut on_feature = [0.0; LANES];
        colour_randomness[0] = 0.0;
        for (k, alpha) in colours.clone().zip(&mut *alpha) {
            let bits = slices.information(k, features.end);
            let w = randomness(sum(&bits[randoms.clone()]), sum(&bits[positions.clone()]));
            *alpha = (1.0 - self.settings.colour_damping * growth * w).max(0.0);
            colour_randomness[0] += w / colours.len() as f32;
            on_all += sum(&bits[..features.end]);
            on_feature.iter_mut().zip(&bits[features.clone()]).for_each(|(sum, bits)| *sum += bits);
        }
        for ((k, beta), on_feature) in features.clone().zip(beta).zip(on_feature) {
            let bits = slices.information(k, positions.end);
            let w = randomness(sum(&bits[randoms.clone()]), sum(&bits[positions.clone()]));
            let share = on_feature / (on_all + f32::MIN_POSITIVE);
            *beta = share * (1.0 - growth * w).max(0.0);
        }
    }
}
