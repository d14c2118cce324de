//! Convolutions of planes: the layers of the network, each with its activation.
//!
//! Vectors hold neighbouring pixels of a row; the sums of several output planes stay in registers while all input planes
//! pass by.

use multiversion::target::match_target;
use rayon::prelude::*;

use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::filter::common::lanes::multiply_add;
use crate::simd::{LANES, apply, multiversioned};

/// Margin of all planes. Its zeros are what a kernel reads beyond the border.
pub const MARGIN: usize = LANES;

/// Output planes that are summed at once, for two vectors of pixels each. On AVX2 that measured 1.1 to 1.4 times as fast as eight planes of one
/// vector; the compiler runs out of registers with six of two.
pub const GROUP: usize = 4;

/// Slope of the activation below 0 (leaky rectified linear unit).
const SLOPE: f32 = 0.05;

/// A convolution by a kernel of 3×3 pixels or of one.
pub struct Convolution {
    inputs: usize,
    outputs: usize,
    side: usize,
    /// `[group][row of the kernel][input][column of the kernel]`, each of the group's output planes.
    weights: Vec<[f32; GROUP]>,
    /// `[group]`.
    bias: Vec<[f32; GROUP]>,
}

impl Convolution {
    /// `weights` are `[row][column][input][output]`, `bias` has a value per output plane.
    pub fn new(side: usize, inputs: usize, weights: &[f32], bias: &[f32]) -> Self {
        let outputs = bias.len();
        let groups = outputs.div_ceil(GROUP);
        let mut packed = Vec::with_capacity(groups * side * side * inputs);
        for group in 0..groups {
            for row in 0..side {
                for input in 0..inputs {
                    for column in 0..side {
                        let start = ((row * side + column) * inputs + input) * outputs;
                        packed.push(grouped(group, outputs, |o| weights[start + o]));
                    }
                }
            }
        }
        let bias = (0..groups).map(|group| grouped(group, outputs, |o| bias[o])).collect();
        Self { inputs, outputs, side, weights: packed, bias }
    }

    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Returns the activated output planes.
    pub fn activate(&self, input: &InterleavedPlanes) -> InterleavedPlanes {
        let (width, height) = (input.width(), input.height());
        let mut output = InterleavedPlanes::new(width, height, self.outputs, MARGIN, 0.0);
        let row_len = output.row_len().max(1);
        output.data_mut().par_chunks_mut(row_len).enumerate().for_each(|(y, out)| {
            stop_if_cancelled();
            self.convolve_row(input, y, out);
            out.iter_mut().for_each(|v| *v = leaky_relu(*v));
        });
        output
    }

    /// Writes a row of all output planes: `[output][stride of the input]`. Margins are 0.
    pub fn convolve_row(&self, input: &InterleavedPlanes, y: usize, out: &mut [f32]) {
        assert_eq!((input.count(), input.margin()), (self.inputs, MARGIN), "planes of this layer's input");
        convolve_row(self, input, y, out);
        for plane in out.chunks_exact_mut(input.stride()) {
            plane[MARGIN + input.width()..].fill(0.0);
        }
    }
}

/// Returns a value of each output plane of a group, 0 of those that do not exist.
pub fn grouped(group: usize, outputs: usize, of: impl Fn(usize) -> f32) -> [f32; GROUP] {
    std::array::from_fn(|o| Some(group * GROUP + o).filter(|&o| o < outputs).map_or(0.0, &of))
}

/// The activation.
#[inline(always)]
pub fn leaky_relu(value: f32) -> f32 {
    value.max(SLOPE * value)
}

#[apply(multiversioned!)]
fn convolve_row(layer: &Convolution, input: &InterleavedPlanes, y: usize, out: &mut [f32]) {
    match_target! {
        "x86_64+avx512f" => sum_row::<16, 2, true>(layer, input, y, out),
        "x86_64+fma" => sum_row::<8, 2, true>(layer, input, y, out),
        "aarch64" => sum_row::<4, 2, true>(layer, input, y, out),
        _ => sum_row::<4, 2, false>(layer, input, y, out),
    }
}

/// Works on `V` vectors of `N` pixels at once.
#[inline(always)]
fn sum_row<const N: usize, const V: usize, const FMA: bool>(
    layer: &Convolution,
    input: &InterleavedPlanes,
    y: usize,
    out: &mut [f32],
) {
    match layer.side {
        1 => sum_kernel::<N, V, 1, FMA>(layer, input, y, out),
        3 => sum_kernel::<N, V, 3, FMA>(layer, input, y, out),
        side => unreachable!("kernels of {side} pixels"),
    }
}

/// The same for a kernel whose side is a constant, without loops over its columns.
#[inline(always)]
fn sum_kernel<const N: usize, const V: usize, const SIDE: usize, const FMA: bool>(
    layer: &Convolution,
    input: &InterleavedPlanes,
    y: usize,
    out: &mut [f32],
) {
    let (reach, stride) = (SIDE / 2, input.stride());
    for x in (0..input.width()).step_by(N * V) {
        let groups = layer.weights.chunks_exact(SIDE * SIDE * layer.inputs);
        for ((weights, bias), out) in groups.zip(&layer.bias).zip(out.chunks_mut(GROUP * stride)) {
            let mut sums = bias.map(|bias| [[bias; N]; V]);
            for (row, weights) in weights.chunks_exact(SIDE * layer.inputs).enumerate() {
                let Some(y) = (y + row).checked_sub(reach).filter(|&y| y < input.height()) else { continue };
                let planes = input.row_planes(y, MARGIN + x - reach);
                for (plane, weights) in planes.zip(weights.as_chunks::<SIDE>().0) {
                    let plane = &plane[..N * V + SIDE - 1];
                    for (column, weights) in weights.iter().enumerate() {
                        let (vectors, _) = plane[column..][..N * V].as_chunks::<N>();
                        for (v, values) in vectors.iter().enumerate().take(V) {
                            for (sums, &weight) in sums.iter_mut().zip(weights) {
                                sums[v] = add_scaled::<N, FMA>(&sums[v], weight, values);
                            }
                        }
                    }
                }
            }
            for (out, sums) in out.chunks_exact_mut(stride).zip(&sums) {
                out[MARGIN + x..][..N * V].copy_from_slice(sums.as_flattened());
            }
        }
    }
}

/// The inner step as a function of whole vectors: loops over their parts in place do not compile to vector code.
#[inline(always)]
pub fn add_scaled<const N: usize, const FMA: bool>(
    sum: &[f32; N],
    weight: f32,
    values: &[f32; N],
) -> [f32; N] {
    std::array::from_fn(|i| multiply_add::<FMA>(weight, values[i], sum[i]))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::image::Planes;

    /// The definition of a convolution, with zeros beyond the border.
    fn plain(side: usize, input: &Planes, weights: &[f32], bias: &[f32], at: (usize, usize, usize)) -> f32 {
        let (output, x, y) = at;
        let reach = side / 2;
        let mut sum = bias[output];
        for row in 0..side {
            for column in 0..side {
                let (x, y) = ((x + column).wrapping_sub(reach), (y + row).wrapping_sub(reach));
                if x < input.width() && y < input.height() {
                    for plane in 0..input.count() {
                        let tap = (row * side + column) * input.count() + plane;
                        sum += weights[tap * bias.len() + output] * input.at(plane, x, y);
                    }
                }
            }
        }
        sum.max(SLOPE * sum)
    }

    #[test]
    fn layers_agree_with_the_definition() {
        let mut rng = Pcg32::seed_from_u64(5);
        for (width, height, side, inputs, outputs) in
            [(1, 1, 3, 2, 3), (37, 5, 3, 3, 9), (32, 2, 1, 5, 16), (50, 3, 3, 4, 8)]
        {
            let mut draw =
                |count: usize| -> Vec<f32> { (0..count).map(|_| rng.random::<f32>() - 0.5).collect() };
            let mut input = Planes::new(width, height, inputs);
            input.data_mut().copy_from_slice(&draw(width * height * inputs));
            let (weights, bias) = (draw(side * side * inputs * outputs), draw(outputs));
            let layer = Convolution::new(side, inputs, &weights, &bias);
            let found = layer.activate(&InterleavedPlanes::from_planes(&input, MARGIN, 0.0));
            for (output, y, x) in indices(outputs, height, width) {
                let expected = plain(side, &input, &weights, &bias, (output, x, y));
                assert!((found.at(output, x, y) - expected).abs() < 1e-5, "{output} {x} {y}");
            }
            assert!(found.row_with_margins(0, 0)[MARGIN + width..].iter().all(|&v| v == 0.0));
        }
    }

    fn indices(a: usize, b: usize, c: usize) -> impl Iterator<Item = (usize, usize, usize)> {
        (0..a * b * c).map(move |i| (i / (b * c), i / c % b, i % c))
    }
}
