//! Filters each sample of a pixel over the pixel's neighbourhood (paper, Eq. 3): the inner loop.
//!
//! Vectors hold several of the pixel's own samples, which are compared with one neighbour at a time.

use multiversion::target::match_target;

use super::neighbourhood::Neighbourhood;
use super::samples::Value;
use crate::filter::common::fast_exp::exp_negative;
use crate::filter::common::lanes::multiply_add;
use crate::filter::prpf::bit_slices::BLOCK_SAMPLES;
use crate::filter::prpf::sample_vector::{MAX_VARIABLES, SampleVector};
use crate::simd::{apply, multiversioned};

/// Own samples in a vector: for pixels with few samples, and with many.
const FEW: usize = 8;
const MANY: usize = 16;

/// Neighbours that are compared with a vector together, so that additions do not depend on each other.
const UNROLL: usize = 4;

/// Memory for the filter of one pixel after the other.
#[derive(Default)]
pub struct Kernel {
    /// Dimensions with weight.
    dims: Vec<usize>,
    few: Groups<FEW>,
    many: Groups<MANY>,
}

/// A pixel's own samples in groups of `N`.
#[derive(Default)]
struct Groups<const N: usize> {
    /// `[group][dimension][sample]`.
    own: Vec<[f32; N]>,
    sums: Vec<Sums<N>>,
}

/// Sums of weights and of weighted values.
#[derive(Clone, Copy)]
struct Sums<const N: usize> {
    weights: [f32; N],
    values: [[f32; N]; CHANNELS],
}

const CHANNELS: usize = 7;

/// Inputs of the filter of one pixel.
struct Input<'a> {
    neighbourhood: &'a Neighbourhood,
    values: &'a [Value],
    scale: &'a SampleVector,
    dims: &'a [usize],
}

impl Input<'_> {
    /// Returns a sample vector relative to the mean of the pixel's own, multiplied by the scale.
    #[inline(always)]
    fn scaled(&self, row: &SampleVector) -> SampleVector {
        let centre = self.neighbourhood.centre();
        std::array::from_fn(|l| (row[l] - centre[l]) * self.scale[l])
    }
}

impl Kernel {
    /// Writes the filtered values of the pixel's own samples, which come first in its neighbourhood. The
    /// exponent of a pair is the squared distance of the sample vectors multiplied by `scale`; `values` are
    /// those of all samples.
    pub fn filter(
        &mut self,
        neighbourhood: &Neighbourhood,
        values: &[Value],
        scale: &SampleVector,
        own: &mut [Value],
    ) {
        self.dims.clear();
        self.dims.extend((0..MAX_VARIABLES).filter(|&dim| scale[dim] > 0.0));
        let input = Input { neighbourhood, values, scale, dims: &self.dims };
        if own.len() <= FEW {
            run(&mut self.few, &input, own);
        } else {
            run(&mut self.many, &input, own);
        }
    }
}

#[apply(multiversioned!)]
fn run<const N: usize>(groups: &mut Groups<N>, input: &Input, own: &mut [Value]) {
    match_target! {
        "x86_64+fma" => groups.filter::<true>(input, own),
        "aarch64" => groups.filter::<true>(input, own),
        _ => groups.filter::<false>(input, own),
    }
}

impl<const N: usize> Groups<N> {
    #[inline(always)]
    fn filter<const FMA: bool>(&mut self, input: &Input, own: &mut [Value]) {
        let (rows, ids, dims) = (input.neighbourhood.rows(), input.neighbourhood.ids(), input.dims);
        // Load the own samples. Sums are of differences from the first, which reproduces constants exactly
        let shift = input.values[ids[0] as usize];
        let groups = own.len().div_ceil(N);
        self.sums.clear();
        self.sums.resize(groups, Sums { weights: [0.0; N], values: [[0.0; N]; CHANNELS] });
        self.own.clear();
        for group in 0..groups {
            // The last sample fills up its group.
            let sample = |l: usize| (group * N + l).min(own.len() - 1);
            let scaled: [_; N] = std::array::from_fn(|l| input.scaled(&rows[sample(l)]));
            self.own.extend(dims.iter().map(|&dim| std::array::from_fn(|l| scaled[l][dim])));
        }

        // Sum over the neighbours. A block of them stays in the first-level cache for all groups
        let mut near = [[0.0; MAX_VARIABLES]; BLOCK_SAMPLES];
        let mut near_values = [shift; BLOCK_SAMPLES];
        for (rows, ids) in rows.chunks(BLOCK_SAMPLES).zip(ids.chunks(BLOCK_SAMPLES)) {
            for ((near, value), (row, &id)) in near.iter_mut().zip(&mut near_values).zip(rows.iter().zip(ids))
            {
                *near = input.scaled(row);
                let next = &input.values[id as usize];
                *value = std::array::from_fn(|c| next[c] - shift[c]);
            }
            let (rows, values) = (&near[..rows.len()], &near_values[..rows.len()]);
            for (group, sums) in self.sums.iter_mut().enumerate() {
                let own = &self.own[group * dims.len()..][..dims.len()];
                let (fours, rest) = rows.as_chunks::<UNROLL>();
                let (four_values, rest_values) = values.as_chunks::<UNROLL>();
                let mut local = *sums;
                for (rows, values) in fours.iter().zip(four_values) {
                    add::<N, UNROLL, FMA>(&mut local, own, dims, rows, values);
                }
                for (row, value) in rest.iter().zip(rest_values) {
                    add::<N, 1, FMA>(&mut local, own, dims, &[*row], &[*value]);
                }
                *sums = local;
            }
        }

        // Divide by the sums of weights
        for (i, own) in own.iter_mut().enumerate() {
            let (sums, l) = (&self.sums[i / N], i % N);
            for c in 0..CHANNELS {
                own[c] = shift[c] + sums.values[c][l] / sums.weights[l];
            }
        }
    }
}

/// Adds some neighbours to the sums of a group.
#[inline(always)]
fn add<const N: usize, const ROWS: usize, const FMA: bool>(
    sums: &mut Sums<N>,
    own: &[[f32; N]],
    dims: &[usize],
    rows: &[SampleVector; ROWS],
    values: &[Value; ROWS],
) {
    let mut exponents = [[0.0; N]; ROWS];
    for (own, &dim) in own.iter().zip(dims) {
        for (exponents, row) in exponents.iter_mut().zip(rows) {
            // The remainder has no effect but to remove a bounds check.
            let other = row[dim % MAX_VARIABLES];
            for l in 0..N {
                let d = own[l] - other;
                exponents[l] = multiply_add::<FMA>(d, d, exponents[l]);
            }
        }
    }
    let weights: [[f32; N]; ROWS] =
        std::array::from_fn(|row| std::array::from_fn(|l| exp_negative(exponents[row][l])));
    for weights in &weights {
        sums.weights = std::array::from_fn(|l| sums.weights[l] + weights[l]);
    }
    // Channel by channel, which keeps the compiler from putting channels into vectors
    for (c, sums) in sums.values.iter_mut().enumerate() {
        let mut sum = *sums;
        for (weights, value) in weights.iter().zip(values) {
            sum = std::array::from_fn(|l| multiply_add::<FMA>(weights[l], value[c], sum[l]));
        }
        *sums = sum;
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::super::samples::Samples;
    use super::super::tests::{candidates, one_pixel};
    use super::*;
    use crate::stats::{Block, Layout};

    /// Filters a pixel with the given colours and albedos of one channel, at a scale of 1.
    fn filtered(samples: &[[f32; 2]]) -> Vec<f32> {
        let layout = Layout::with_blocks(|block| block == Block::Albedo);
        let vectors: Vec<Vec<f32>> = samples
            .iter()
            .map(|&[colour, albedo]| {
                let mut vector = vec![0.0; layout.len()];
                layout.write(&mut vector, Block::Colour, &[colour, 0.0, 0.0]);
                layout.write(&mut vector, Block::Albedo, &[albedo, 0.0, 0.0]);
                vector
            })
            .collect();
        let store = one_pixel(&layout, &vectors);
        let samples = Samples::from_store(&store);
        let (sampler, clustering) = candidates(&samples, &layout);
        let mut neighbourhood = Neighbourhood::new(&sampler, &samples);
        neighbourhood.gather(&samples, &sampler, &clustering, (0, 0), (1, 0));
        let mut scale = [0.0; MAX_VARIABLES];
        scale[layout.block(Block::Albedo).unwrap().start] = 1.0;
        let values = samples.values();
        let mut own = values.clone();
        Kernel::default().filter(&neighbourhood, &values, &scale, &mut own);
        own.iter().map(|value| value[0]).collect()
    }

    #[test]
    fn weights_are_exponentials_of_squared_distances() {
        // The weights are e⁻¹ and, of the sample itself, 1.
        let fraction = (-1f32).exp() / (1.0 + (-1f32).exp());
        let [a, b] = filtered(&[[0.0, 3.0], [1.0, 4.0]])[..] else { panic!("two samples") };
        assert!((a - fraction).abs() < 1e-4 && (b - (1.0 - fraction)).abs() < 1e-4, "{a} {b}");
    }

    #[test]
    fn few_and_many_samples_agree_with_the_definition() {
        let mut rng = Pcg32::seed_from_u64(4);
        for count in [1, 5, 8, 9, 16, 17, 70] {
            let samples: Vec<[f32; 2]> =
                (0..count).map(|_| [rng.random(), 3.0 * rng.random::<f32>()]).collect();
            for ([_, own], found) in samples.iter().zip(filtered(&samples)) {
                let weight = |other: f32| (-f64::from(own - other).powi(2)).exp();
                let total: f64 = samples.iter().map(|s| weight(s[1])).sum();
                let sum: f64 = samples.iter().map(|s| weight(s[1]) * f64::from(s[0])).sum();
                assert!(
                    (f64::from(found) - sum / total).abs() < 1e-4,
                    "{count}: {found} for {}",
                    sum / total
                );
            }
        }
    }
}
