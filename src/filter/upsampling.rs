//! Feature weights everywhere from few pixels (paper, section 4.3): computed on a sparse grid,
//! interpolated by a joint bilateral filter between the grid's nodes, and computed directly where
//! no nodes resemble a pixel.

use multiversion::multiversion;
use rayon::prelude::*;

use super::neighbourhood::{Guide, Neighbourhood};
use super::padded::Padded;
use super::prpf::PrpfSettings;
use super::weights::{Evidence, Scratch};

/// Nodes from which a pixel is interpolated: the 4×4 around it.
const SIDE: usize = 4;
const NODES: usize = SIDE * SIDE;

/// Least variance of a feature in a distance to nodes, as share of the neighbourhood's.
const LEAST_FEATURE_VARIANCE: f32 = 1e-4;

/// Least relative variance of a colour.
const LEAST_COLOUR_VARIANCE: f32 = 1e-8;

/// Least variance of anything.
const TINY: f32 = 1e-12;

/// Nodes: every `spacing`-th pixel, from the middle of the first `spacing` on.
struct Grid {
    spacing: usize,
    xs: Vec<usize>,
    ys: Vec<usize>,
}

impl Grid {
    fn new(width: usize, height: usize, spacing: usize) -> Self {
        let spacing = spacing.max(1);
        let axis = |size: usize| {
            (0..size).step_by(spacing).map(|start| (start + spacing / 2).min(size - 1)).collect()
        };
        Self { spacing, xs: axis(width), ys: axis(height) }
    }

    /// All nodes, row by row.
    fn nodes(&self) -> Vec<(usize, usize)> {
        (0..self.xs.len() * self.ys.len()).map(|node| self.node(node)).collect()
    }

    fn node(&self, node: usize) -> (usize, usize) {
        (self.xs[node % self.xs.len()], self.ys[node / self.xs.len()])
    }

    /// Along one axis, how many nodes lie at or before a pixel: two of those and two after them are
    /// the nodes around it.
    fn block(&self, nodes: &[usize], at: usize) -> usize {
        ((at + self.spacing - self.spacing / 2) / self.spacing).min(nodes.len())
    }

    /// Indices of the nodes around a pixel, by its blocks.
    fn around(&self, (bx, by): (usize, usize)) -> [Option<usize>; NODES] {
        std::array::from_fn(|n| {
            let x = (bx + n % SIDE).checked_sub(SIDE / 2).filter(|&x| x < self.xs.len())?;
            let y = (by + n / SIDE).checked_sub(SIDE / 2).filter(|&y| y < self.ys.len())?;
            Some(y * self.xs.len() + x)
        })
    }
}

/// The weights of one pass at all pixels: plane for plane what [`Evidence::evaluate`] writes, then
/// the sum of interpolation weights, infinite where nothing was to be interpolated.
pub(super) fn weights(evidence: &Evidence) -> Padded {
    let settings = evidence.settings;
    let (width, height) = (evidence.guide.width(), evidence.guide.height());
    let mut weights = Padded::new(width, height, evidence.len() + 1, 0, f32::INFINITY);
    if !settings.upsampling {
        let pixels: Vec<_> = (0..width * height).map(|i| (i % width, i / width)).collect();
        write_at(&mut weights, &pixels, &evaluate(evidence, &pixels));
        return weights;
    }
    let grid = Grid::new(width, height, settings.grid_spacing);
    let nodes = grid.nodes();
    let values = evaluate(evidence, &nodes);
    interpolate(evidence.guide, evidence.neighbourhood, evidence.window, &grid, &values, &mut weights);
    write_at(&mut weights, &nodes, &values);
    nodes.iter().for_each(|&(x, y)| weights.set(evidence.len(), x, y, f32::INFINITY));
    let failed: Vec<_> = (0..width * height)
        .map(|i| (i % width, i / width))
        .filter(|&(x, y)| weights.at(evidence.len(), x, y) <= settings.interpolation_threshold)
        .collect();
    write_at(&mut weights, &failed, &evaluate(evidence, &failed));
    weights
}

/// The sums of interpolation weights alone, as [`weights`] gives them.
pub(super) fn confidence(
    guide: &Guide,
    neighbourhood: &Neighbourhood,
    window: usize,
    settings: &PrpfSettings,
) -> Padded {
    let mut sums = Padded::new(guide.width(), guide.height(), 1, 0, f32::INFINITY);
    let grid = Grid::new(guide.width(), guide.height(), settings.grid_spacing);
    interpolate(guide, neighbourhood, window, &grid, &[], &mut sums);
    for (x, y) in grid.nodes() {
        sums.set(0, x, y, f32::INFINITY);
    }
    sums
}

/// Computes weights directly, pixel after pixel.
fn evaluate(evidence: &Evidence, pixels: &[(usize, usize)]) -> Vec<f32> {
    let mut values = vec![0.0; pixels.len() * evidence.len()];
    values
        .par_chunks_mut(evidence.len())
        .zip(pixels)
        .for_each_init(|| Scratch::new(evidence), |scratch, (out, &i)| evidence.evaluate(i, scratch, out));
    values
}

fn write_at(weights: &mut Padded, pixels: &[(usize, usize)], values: &[f32]) {
    let count = weights.count() - 1;
    for (&(x, y), values) in pixels.iter().zip(values.chunks(count)) {
        values.iter().enumerate().for_each(|(k, &value)| weights.set(k, x, y, value));
    }
}

/// Writes the interpolated `values` (of each node, one after the other) and the sums.
fn interpolate(
    guide: &Guide,
    neighbourhood: &Neighbourhood,
    window: usize,
    grid: &Grid,
    values: &[f32],
    out: &mut Padded,
) {
    let (row_len, stride) = (out.row_len().max(1), out.stride());
    let film = 12.0 / (window * window) as f32;
    out.data_mut().par_chunks_mut(row_len).enumerate().for_each(|(y, out)| {
        interpolate_row(guide, neighbourhood, grid, film, values, y, stride, out);
    });
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
#[expect(clippy::too_many_arguments, reason = "a function chosen at run time cannot be a closure")]
fn interpolate_row(
    guide: &Guide,
    neighbourhood: &Neighbourhood,
    grid: &Grid,
    film: f32,
    values: &[f32],
    y: usize,
    stride: usize,
    out: &mut [f32],
) {
    let planes = out.len() / stride - 1;
    let dims = guide.features() + 3;
    let mut block = None;
    let (mut xs, mut ys, mut hits) = ([0.0; NODES], [0.0; NODES], [Guide::NOTHING; NODES]);
    let mut means = vec![[0.0; NODES]; dims];
    let mut node_values = vec![[0.0; NODES]; planes];
    for x in 0..guide.width() {
        let here = (grid.block(&grid.xs, x), grid.block(&grid.ys, y));
        if block != Some(here) {
            block = Some(here);
            hits = [Guide::NOTHING; NODES];
            for (n, node) in grid.around(here).into_iter().enumerate() {
                let Some(node) = node else { continue };
                let (xn, yn) = grid.node(node);
                (xs[n], ys[n], hits[n]) = (xn as f32, yn as f32, guide.hit.at(0, xn, yn));
                means.iter_mut().enumerate().for_each(|(k, means)| means[n] = guide.means.at(k, xn, yn));
                let values = &values[node * planes..][..planes];
                node_values.iter_mut().zip(values).for_each(|(out, &value)| out[n] = value);
            }
        }
        let mut exponents = [0.0; NODES];
        for n in 0..NODES {
            let (dx, dy) = (xs[n] - x as f32, ys[n] - y as f32);
            exponents[n] = film * (dx * dx + dy * dy);
        }
        for (k, means) in means.iter().enumerate() {
            let own = guide.means.at(k, x, y);
            let around = neighbourhood.variance(k, x, y);
            let variance = match guide.tolerances.get(k) {
                Some(z) => z * z * guide.variances.at(k, x, y) + LEAST_FEATURE_VARIANCE * around,
                None => around + LEAST_COLOUR_VARIANCE * own * own,
            };
            let factor = 1.0 / (variance + TINY);
            for n in 0..NODES {
                let d = means[n] - own;
                exponents[n] += factor * d * d;
            }
        }
        let mut weights = [0.0; NODES];
        let hit = guide.own_hit.at(0, x, y);
        for n in 0..NODES {
            if (hits[n] - hit).abs() <= Guide::HIT_TOLERANCE {
                weights[n] = (-0.5 * exponents[n]).exp();
            }
        }
        let sum: f32 = weights.iter().sum();
        for (k, values) in node_values.iter().enumerate() {
            let weighted: f32 = weights.iter().zip(values).map(|(w, v)| w * v).sum();
            out[k * stride + x] = if sum > 0.0 { weighted / sum } else { 0.0 };
        }
        out[planes * stride + x] = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_in_the_middle_of_every_cell_and_inside_the_image() {
        let grid = Grid::new(12, 1, 5);
        assert_eq!(grid.nodes(), [(2, 0), (7, 0), (11, 0)]);
        assert_eq!(Grid::new(1, 1, 5).nodes(), [(0, 0)]);
        assert_eq!(Grid::new(3, 3, 1).nodes().len(), 9);
    }

    #[test]
    fn the_nodes_around_a_pixel_are_the_nearest_along_each_axis() {
        let grid = Grid::new(100, 100, 5);
        for (x, expected) in [(50, [42, 47, 52, 57]), (52, [47, 52, 57, 62]), (51, [42, 47, 52, 57])] {
            let around = grid.around((grid.block(&grid.xs, x), grid.block(&grid.ys, 50)));
            let xs = around[..SIDE].iter().map(|node| grid.node(node.expect("inside")).0);
            assert!(xs.eq(expected), "{x}");
        }
        // At a corner, only those inside.
        let around = grid.around((grid.block(&grid.xs, 0), grid.block(&grid.ys, 0)));
        let inside: Vec<_> = around.into_iter().flatten().map(|node| grid.node(node)).collect();
        assert_eq!(inside, [(2, 2), (7, 2), (2, 7), (7, 7)]);
    }

    #[test]
    fn interpolation_is_the_joint_bilateral_mean_of_the_nodes_around() {
        use rand::RngExt;

        use super::super::colours::Colours;
        use super::super::synthetic::{store, wall};
        use crate::stats::{Block, Layout};

        // The last node of each axis lies where its cell's middle is.
        let (width, height, window) = (23, 18, 17);
        let layout = Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Albedo | Block::Hit));
        let store = store(
            width,
            height,
            layout.clone(),
            |_, _| 8,
            |x, y, _, rng| {
                let mut sample = wall(&layout, x, y, [rng.random(), 1.0, 0.1 * x as f32], rng);
                let noise = 0.5 * rng.random::<f32>();
                layout.write(&mut sample, Block::Albedo, &[0.5, 0.3 + noise, 0.1 * y as f32 + noise]);
                layout.write(&mut sample, Block::Hit, &[f32::from(y > 4)]);
                sample
            },
        );
        let settings = PrpfSettings::paper();
        let guide = Guide::new(&store, Colours::new(&store, &settings.outliers).guide(), &settings);
        let hood = Neighbourhood::new(&guide, window, 9);
        let grid = Grid::new(width, height, 5);
        let values: Vec<f32> = (0..2 * grid.nodes().len()).map(|i| (i * 29 % 17) as f32).collect();
        let mut found = Padded::new(width, height, 3, 0, 0.0);
        interpolate(&guide, &hood, window, &grid, &values, &mut found);

        let axis = |size: usize| (2..size).step_by(5).collect::<Vec<_>>();
        let (xs, ys) = (axis(width), axis(height));
        let around = |nodes: &[usize], at: usize| {
            let before = nodes.iter().filter(|&&node| node <= at).count();
            before.saturating_sub(2)..(before + 2).min(nodes.len())
        };
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let (mut sums, mut total) = ([0.0; 2], 0.0);
            for (i, j) in around(&ys, y).flat_map(|j| around(&xs, x).map(move |i| (i, j))) {
                let (xn, yn) = (xs[i], ys[j]);
                if (guide.own_hit.at(0, x, y) - guide.hit.at(0, xn, yn)).abs() > 0.5 {
                    continue;
                }
                let squared = (x.abs_diff(xn).pow(2) + y.abs_diff(yn).pow(2)) as f64;
                let mut exponent = 12.0 * squared / (window * window) as f64;
                for k in 0..guide.features() + 3 {
                    let own = f64::from(guide.means.at(k, x, y));
                    let around = f64::from(hood.variance(k, x, y));
                    let variance = if k < guide.features() {
                        let z = f64::from(guide.tolerances[k]);
                        z * z * f64::from(guide.variances.at(k, x, y)) + 1e-4 * around
                    } else {
                        around + 1e-8 * own * own
                    };
                    exponent += (f64::from(guide.means.at(k, xn, yn)) - own).powi(2) / (variance + 1e-12);
                }
                let weight = (-exponent / 2.0).exp();
                total += weight;
                let node = j * xs.len() + i;
                sums[0] += weight * f64::from(values[2 * node]);
                sums[1] += weight * f64::from(values[2 * node + 1]);
            }
            let sum = f64::from(found.at(2, x, y));
            assert!((sum - total).abs() < 1e-3 * total + 1e-30, "{x} {y}: {sum} for {total}");
            for (k, expected) in sums.into_iter().enumerate().filter(|_| total > 1e-20) {
                let (value, expected) = (f64::from(found.at(k, x, y)), expected / total);
                assert!((value - expected).abs() < 2e-2, "{x} {y} {k}: {value} for {expected}");
            }
        }
    }
}
