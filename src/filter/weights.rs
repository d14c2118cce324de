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
pub(super) struct Scratch {
    variables: Variables,
    cluster: Vec<(u32, u32)>,
    slices: BitSlices,
    block: Box<[[f32; LANES]; WORD]>,
}

impl Scratch {
    pub fn new(evidence: &Evidence) -> Self {
        Self {
            variables: Variables::new(evidence.store.layout(), evidence.guide.feature_dims()),
            cluster: Vec::new(),
            slices: BitSlices::new(evidence.settings.mi_samples),
            block: Box::new([[NO_SAMPLE; LANES]; WORD]),
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

    /// Takes the pixel's own kept samples and as many of the rest of the cluster's as are wanted,
    /// every pixel of it with the same chance. Returns their number.
    fn gather(&self, i: (usize, usize), standard: &Standard, scratch: &mut Scratch) -> usize {
        let Scratch { variables, cluster, slices, block } = scratch;
        slices.clear();
        let dims = self.store.layout().len();
        let (mut taken, mut filled) = (0, 0);
        let mut take = |sample: &[f32]| {
            copy(sample, &mut block[filled]);
            filled += 1;
            taken += 1;
            if filled == WORD {
                slices.push(block, WORD, standard, &variables.dims);
                filled = 0;
            }
        };

        let kept = |(x, y): (usize, usize)| self.store.rows()[y].reservoir(x);
        let at = |p: usize| (cluster[p].0 as usize, cluster[p].1 as usize);
        let wanted = if self.store.capacity() > 0 { self.settings.mi_samples } else { 0 };
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

        if filled > 0 {
            block[filled..].fill([NO_SAMPLE; LANES]);
            slices.push(block, filled, standard, &variables.dims);
        }
        taken
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
mod tests {
    use super::super::colours::Colours;
    use super::super::synthetic::{store, wall};
    use super::*;
    use crate::stats::Block;

    const LENS: usize = 0;
    const ALBEDO: usize = 3;

    /// Weights at the centre of a wall whose albedo alone makes its colour and whose normal is
    /// nothing but the lens sample and the time: β of normal and albedo, α, W_c^r.
    fn weights(
        count: impl Fn(usize, usize) -> u32 + Sync,
        albedo: impl Fn(usize, usize) -> f32 + Sync,
    ) -> Vec<f32> {
        use Block::{Albedo, Hit, Lens, Normal1, Time};
        let layout = Layout::with_blocks(|b| matches!(b, Normal1 | Albedo | Lens | Time | Hit));
        let randoms = layout.randoms();
        let store = store(56, 56, layout.clone(), count, |x, y, _, rng| {
            let albedo = albedo(x, y);
            let mut sample = wall(&layout, x, y, [albedo, 0.5 * albedo, 0.2], rng);
            let normal = [0, 1, 2].map(|k| sample[randoms[k]]);
            layout.write(&mut sample, Normal1, &normal);
            layout.write(&mut sample, Albedo, &[albedo, albedo, 0.2]);
            sample
        });
        evaluate(&store, 10.0)
    }

    /// The weights at the centre, in the first pass. Normals within `tolerance` resemble each other.
    fn evaluate(store: &Store, tolerance: f32) -> Vec<f32> {
        let settings = PrpfSettings { tolerance, ..PrpfSettings::paper() };
        let colours = Colours::new(store, &settings.outliers);
        let guide = Guide::new(store, colours.guide(), &settings);
        let evidence = Evidence {
            store,
            guide: &guide,
            neighbourhood: &Neighbourhood::new(&guide, 55, 9),
            exposure: colours.exposure(),
            settings: &settings,
            pass: 0,
            window: 55,
            seed: 3,
        };
        let mut weights = vec![0.0; evidence.len()];
        evidence.evaluate((28, 28), &mut Scratch::new(&evidence), &mut weights);
        weights
    }

    fn uneven(x: usize, y: usize) -> u32 {
        1 + (x * 31 + y * 17) as u32 % 64
    }

    fn check(albedo: impl Fn(usize, usize) -> f32 + Sync + Copy, least: f32) {
        for (name, weights) in [
            ("8", weights(|_, _| 8, albedo)),
            ("64", weights(|_, _| 64, albedo)),
            ("uneven", weights(uneven, albedo)),
        ] {
            let noise: f32 = weights[LENS..LENS + 3].iter().sum();
            let explaining: f32 = weights[ALBEDO..ALBEDO + 2].iter().sum();
            assert!(noise < 0.01, "{name}: {weights:?}");
            assert!(explaining > least, "{name}: {weights:?}");
            assert_eq!(weights[ALBEDO + 2], 0.0, "a constant feature");
        }
    }

    #[test]
    fn features_that_follow_position_and_explain_the_colour_get_the_weight_and_noise_gets_none() {
        // Not all of it: the position explains the colour as well as either of two features.
        check(|x, _| 0.1 + 0.01 * x as f32, 0.6);
    }

    #[test]
    fn features_without_relation_to_one_coordinate_keep_the_weight_that_null_information_leaves() {
        // Neither x nor y alone says anything on a random pattern, so that of the information on
        // it, all of it chance, 3 parts in 5 belong to the 3 random parameters: 1 - W = 0.4.
        check(|x, y| 0.2 + 0.1 * ((x * x * 7 + y * y * 13 + x * y * 5) % 7) as f32, 0.3);
    }

    #[test]
    fn noise_in_the_colour_takes_its_weight() {
        use Block::{Lens, Normal1};
        let layout = Layout::with_blocks(|b| matches!(b, Normal1 | Lens));
        let lens = layout.randoms()[0];
        let store = store(
            56,
            56,
            layout.clone(),
            |_, _| 8,
            |x, y, _, rng| {
                let sample = wall(&layout, x, y, [0.0; 3], rng);
                let light = sample[lens];
                let mut sample = sample;
                layout.write(&mut sample, Block::Colour, &[light, light, x as f32 / 56.0]);
                sample
            },
        );
        let [.., red, green, blue, randomness] = evaluate(&store, 0.1)[..] else { panic!("four at least") };
        assert_eq!([red, green], [0.0; 2]);
        assert!(blue > 0.9, "{blue}");
        assert!((randomness - 2.0 / 3.0).abs() < 0.05, "{randomness}");
    }

    #[test]
    fn copies_are_whole_at_any_length() {
        for n in 0..=LANES {
            let sample: Vec<f32> = (0..n).map(|i| i as f32).collect();
            let mut to = [-1.0; LANES];
            copy(&sample, &mut to);
            assert_eq!(to[..n], sample);
            assert!(to[n..].iter().all(|&v| v == -1.0));
        }
    }
}
