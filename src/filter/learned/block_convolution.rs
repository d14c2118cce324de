//! Convolutions by kernels of 3×3 pixels that compute four rows at once, with half of the multiplications of their definition: F(4, 3)
//! of Winograd's minimal filtering (Lavin and Gray 2016, section 4.1) along the columns.
//!
//! Six rows of the input are combined into six others, row by row convolved by the kernel's likewise combined rows, and the
//! results combined into four rows. Results differ from the definition by rounding; they depend on which rows are a block, so that
//! parts of an image have to begin with one.

use multiversion::target::match_target;
use rayon::prelude::*;

use super::convolution::{GROUP, MARGIN, add_scaled, grouped, leaky_relu};
use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::simd::{LANES, apply, multiversioned};

/// Rows of a block.
pub const BLOCK_ROWS: usize = 4;

/// Rows of the input that a block reads, and combinations of them.
const COMBINED: usize = BLOCK_ROWS + 2;

/// Columns that are computed at once.
const TILE_WIDTH: usize = 2 * LANES;

/// Columns of the input for these, in whole vectors.
const TILE_STRIDE: usize = 3 * LANES;

/// Combinations of the kernel's rows: G of Lavin and Gray.
const KERNEL_ROWS: [[f32; 3]; COMBINED] = [
    [0.25, 0.0, 0.0],
    [-1.0 / 6.0, -1.0 / 6.0, -1.0 / 6.0],
    [-1.0 / 6.0, 1.0 / 6.0, -1.0 / 6.0],
    [1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
    [1.0 / 24.0, -1.0 / 12.0, 1.0 / 6.0],
    [0.0, 0.0, 1.0],
];

/// A convolution by a kernel of 3×3 pixels.
pub struct BlockConvolution {
    inputs: usize,
    outputs: usize,
    /// `[combination][group][input][column of the kernel]`, each of the group's output planes.
    weights: Vec<[f32; GROUP]>,
    /// `[group]`.
    bias: Vec<[f32; GROUP]>,
}

impl BlockConvolution {
    /// `weights` are `[row][column][input][output]`, `bias` has a value per output plane.
    pub fn new(inputs: usize, weights: &[f32], bias: &[f32]) -> Self {
        let outputs = bias.len();
        let groups = outputs.div_ceil(GROUP);
        let mut packed = Vec::with_capacity(COMBINED * groups * inputs * 3);
        for factors in KERNEL_ROWS {
            for group in 0..groups {
                for (input, column) in (0..inputs).flat_map(|input| (0..3).map(move |column| (input, column)))
                {
                    let weight = |row: usize, output: usize| {
                        weights[((row * 3 + column) * inputs + input) * outputs + output]
                    };
                    let combined = |o: usize| (0..3).map(|row| factors[row] * weight(row, o)).sum();
                    packed.push(grouped(group, outputs, combined));
                }
            }
        }
        let bias = (0..groups).map(|group| grouped(group, outputs, |o| bias[o])).collect();
        Self { inputs, outputs, weights: packed, bias }
    }

    /// Returns the activated output planes.
    pub fn activate(&self, input: &InterleavedPlanes) -> InterleavedPlanes {
        assert_eq!((input.count(), input.margin()), (self.inputs, MARGIN), "planes of this layer's input");
        let mut output = InterleavedPlanes::new(input.width(), input.height(), self.outputs, MARGIN, 0.0);
        let row_len = output.row_len().max(1);
        let blocks = output.data_mut().par_chunks_mut(BLOCK_ROWS * row_len);
        blocks.enumerate().for_each_init(
            || Scratch::new(self),
            |scratch, (block, out)| {
                stop_if_cancelled();
                activate_block(self, input, block * BLOCK_ROWS, scratch, out);
            },
        );
        output
    }
}

/// A tile's intermediate values.
struct Scratch {
    /// Combined rows of the input: `[combination][input][column]`.
    combined: Vec<[f32; TILE_STRIDE]>,
    /// Their convolutions: `[combination][output][column]`.
    convolved: Vec<[f32; TILE_WIDTH]>,
}

impl Scratch {
    fn new(layer: &BlockConvolution) -> Self {
        let outputs = layer.bias.len() * GROUP;
        Self {
            combined: vec![[0.0; TILE_STRIDE]; COMBINED * layer.inputs],
            convolved: vec![[0.0; TILE_WIDTH]; COMBINED * outputs],
        }
    }
}

/// Writes the rows of a block, of which there are as many as `out` has, from row `y` on.
#[apply(multiversioned!)]
fn activate_block(
    layer: &BlockConvolution,
    input: &InterleavedPlanes,
    y: usize,
    scratch: &mut Scratch,
    out: &mut [f32],
) {
    match_target! {
        "x86_64+avx512f" => activate_tiles::<16, true>(layer, input, y, scratch, out),
        "x86_64+fma" => activate_tiles::<8, true>(layer, input, y, scratch, out),
        "aarch64" => activate_tiles::<4, true>(layer, input, y, scratch, out),
        _ => activate_tiles::<4, false>(layer, input, y, scratch, out),
    }
}

#[inline(always)]
fn activate_tiles<const N: usize, const FMA: bool>(
    layer: &BlockConvolution,
    input: &InterleavedPlanes,
    y: usize,
    scratch: &mut Scratch,
    out: &mut [f32],
) {
    for x in (0..input.width()).step_by(TILE_WIDTH) {
        combine_input(input, x, y, &mut scratch.combined);
        convolve::<N, FMA>(layer, scratch);
        combine_output(layer, input, x, scratch, out);
    }
}

/// Combines the rows of the input around a tile: Bᵀ of Lavin and Gray. Rows beyond the border are 0.
#[inline(always)]
fn combine_input(input: &InterleavedPlanes, x: usize, y: usize, combined: &mut [[f32; TILE_STRIDE]]) {
    let zeros = [0.0; TILE_STRIDE];
    for plane in 0..input.count() {
        let row = |k: usize| -> &[f32; TILE_STRIDE] {
            match (y + k).checked_sub(1).filter(|&y| y < input.height()) {
                Some(y) => input.span(plane, y, MARGIN + x - 1),
                None => &zeros,
            }
        };
        let [a, b, c, d, e, f] = [row(0), row(1), row(2), row(3), row(4), row(5)];
        let mut rows = [[0.0; TILE_STRIDE]; COMBINED];
        for i in 0..TILE_STRIDE {
            let (even, odd) = (e[i] - 4.0 * c[i], d[i] - 4.0 * b[i]);
            let (near, far) = (e[i] - c[i], 2.0 * (d[i] - b[i]));
            rows[0][i] = 4.0 * a[i] - 5.0 * c[i] + e[i];
            rows[1][i] = even + odd;
            rows[2][i] = even - odd;
            rows[3][i] = near + far;
            rows[4][i] = near - far;
            rows[5][i] = 4.0 * b[i] - 5.0 * d[i] + f[i];
        }
        for (k, row) in rows.iter().enumerate() {
            combined[k * input.count() + plane] = *row;
        }
    }
}

/// Convolves the combined rows by the combined rows of the kernel.
#[inline(always)]
fn convolve<const N: usize, const FMA: bool>(layer: &BlockConvolution, scratch: &mut Scratch) {
    let per_group = 3 * layer.inputs;
    let rows = scratch.combined.chunks_exact(layer.inputs);
    let weights = layer.weights.chunks_exact(layer.bias.len() * per_group);
    let outputs = scratch.convolved.chunks_exact_mut(layer.bias.len() * GROUP);
    for ((row, weights), outputs) in rows.zip(weights).zip(outputs) {
        for (weights, outputs) in weights.chunks_exact(per_group).zip(outputs.as_chunks_mut::<GROUP>().0) {
            // Two passes over the planes where a vector is half as long
            for start in (0..TILE_WIDTH).step_by(2 * N) {
                let mut sums = [[[0.0; N]; 2]; GROUP];
                for (plane, weights) in row.iter().zip(weights.as_chunks::<3>().0) {
                    let plane = &plane[start..][..2 * N + 2];
                    for (column, weights) in weights.iter().enumerate() {
                        let (vectors, _) = plane[column..][..2 * N].as_chunks::<N>();
                        for (v, values) in vectors.iter().enumerate().take(2) {
                            for (sums, &weight) in sums.iter_mut().zip(weights) {
                                sums[v] = add_scaled::<N, FMA>(&sums[v], weight, values);
                            }
                        }
                    }
                }
                for (output, sums) in outputs.iter_mut().zip(&sums) {
                    output[start..][..2 * N].copy_from_slice(sums.as_flattened());
                }
            }
        }
    }
}

/// Combines the convolved rows into those of the output, Aᵀ of Lavin and Gray, adds the bias and activates them.
#[inline(always)]
fn combine_output(
    layer: &BlockConvolution,
    input: &InterleavedPlanes,
    x: usize,
    scratch: &Scratch,
    out: &mut [f32],
) {
    let groups = layer.bias.len() * GROUP;
    let (stride, inside) = (input.stride(), TILE_WIDTH.min(input.width() - x));
    for output in 0..layer.outputs {
        let bias = layer.bias[output / GROUP][output % GROUP];
        let row = |k: usize| &scratch.convolved[k * groups + output];
        let [a, b, c, d, e, f] = [row(0), row(1), row(2), row(3), row(4), row(5)];
        let mut rows = [[0.0; TILE_WIDTH]; BLOCK_ROWS];
        for i in 0..TILE_WIDTH {
            let (sum, difference) = (b[i] + c[i], b[i] - c[i]);
            let (far_sum, far_difference) = (d[i] + e[i], d[i] - e[i]);
            rows[0][i] = leaky_relu(bias + a[i] + sum + far_sum);
            rows[1][i] = leaky_relu(bias + difference + 2.0 * far_difference);
            rows[2][i] = leaky_relu(bias + sum + 4.0 * far_sum);
            rows[3][i] = leaky_relu(bias + difference + 8.0 * far_difference + f[i]);
        }
        for (out, row) in out.chunks_exact_mut(layer.outputs * stride).zip(&rows) {
            out[output * stride + MARGIN + x..][..inside].copy_from_slice(&row[..inside]);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::super::convolution::Convolution;
    use super::*;
    use crate::image::Planes;

    #[test]
    fn blocks_agree_with_the_definition() {
        let mut rng = Pcg32::seed_from_u64(7);
        for (width, height, inputs, outputs) in [(1, 1, 2, 3), (70, 8, 3, 9), (33, 6, 5, 16), (32, 3, 1, 4)] {
            let mut draw =
                |count: usize| -> Vec<f32> { (0..count).map(|_| rng.random::<f32>() - 0.5).collect() };
            let mut input = Planes::new(width, height, inputs);
            input.data_mut().copy_from_slice(&draw(width * height * inputs));
            let (weights, bias) = (draw(9 * inputs * outputs), draw(outputs));
            let input = InterleavedPlanes::from_planes(&input, MARGIN, 0.0);
            let found = BlockConvolution::new(inputs, &weights, &bias).activate(&input);
            let expected = Convolution::new(3, inputs, &weights, &bias).activate(&input);
            for (found, expected) in found.to_planes().data().iter().zip(expected.to_planes().data()) {
                assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            }
            assert!(found.row_with_margins(0, 0)[MARGIN + width..].iter().all(|&v| v == 0.0));
        }
    }

    #[test]
    fn parts_that_begin_with_a_block_are_those_of_the_whole() {
        let mut rng = Pcg32::seed_from_u64(9);
        let mut planes = Planes::new(20, 16, 2);
        planes.data_mut().fill_with(|| rng.random::<f32>());
        let weights: Vec<f32> = (0..9 * 2 * 4).map(|_| rng.random::<f32>() - 0.5).collect();
        let layer = BlockConvolution::new(2, &weights, &[0.1; 4]);
        let whole = layer.activate(&InterleavedPlanes::from_planes(&planes, MARGIN, 0.0));
        let mut part = Planes::new(20, 12, 2);
        part.paste(&planes, [0, 4], [0, 0], [20, 12]);
        let part = layer.activate(&InterleavedPlanes::from_planes(&part, MARGIN, 0.0));
        // The first row of the part has other neighbours
        for y in 1..12 {
            assert_eq!(part.row(3, y), whole.row(3, y + 4));
        }
    }
}
