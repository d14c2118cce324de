//! A piecewise-constant density over the unit square, sampled by inverting its marginal and conditional
//! distribution functions (`PiecewiseConstant2D` in pbrt-v4, section A.5).
//!
//! The inversion is continuous within a row, so that the samples keep the stratification of the sample values.

use glam::Vec2;
use rayon::prelude::*;

/// A piecewise-constant density over a grid of `width` × `height` cells of the unit square.
#[derive(Clone, Debug)]
pub struct PiecewiseConstant2d {
    width: usize,
    /// Marginal distribution function over rows: `height + 1` values from 0 to 1.
    marginal: Vec<f32>,
    /// For each row, the conditional distribution function over its cells: `width + 1` values from 0 to 1.
    conditional: Vec<f32>,
}

impl PiecewiseConstant2d {
    /// A density in proportion to `weights`: row by row, non-negative and finite. `None` if all are 0.
    pub fn new(width: usize, weights: &[f32]) -> Option<Self> {
        if width == 0 {
            return None;
        }
        let mut conditional = vec![0.0_f32; weights.len() / width * (width + 1)];
        let rows = conditional.par_chunks_exact_mut(width + 1).zip(weights.par_chunks_exact(width));
        let sums: Vec<f64> = rows.map(|(cdf, row)| write_cdf(cdf, row)).collect();
        let mut marginal = vec![0.0_f32; sums.len() + 1];
        let total = write_cdf(&mut marginal, &sums);
        (total > 0.0).then_some(Self { width, marginal, conditional })
    }

    fn height(&self) -> usize {
        self.marginal.len() - 1
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.conditional[y * (self.width + 1)..][..self.width + 1]
    }

    /// Maps `u` in [0, 1)² to a point of the unit square and returns it with its density.
    #[inline]
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let (row, y, density_y) = invert(&self.marginal, u.y);
        let (_, x, density_x) = invert(self.row(row), u.x);
        (Vec2::new(x, y), density_x * density_y)
    }

    /// Density at a point of the unit square.
    #[inline]
    pub fn pdf(&self, point: Vec2) -> f32 {
        let cell = |t: f32, n: usize| ((t * n as f32) as usize).min(n - 1);
        let y = cell(point.y, self.height());
        let x = cell(point.x, self.width);
        let row = self.row(y);
        (row[x + 1] - row[x])
            * (self.marginal[y + 1] - self.marginal[y])
            * (self.width * self.height()) as f32
    }
}

/// Writes the normalised distribution function of `weights` (all 0 if the weights are) to `cdf`, which has one
/// element more and begins with 0. Returns the sum of the weights.
fn write_cdf<T: Copy + Into<f64>>(cdf: &mut [f32], weights: &[T]) -> f64 {
    let total: f64 = weights.iter().map(|&w| w.into()).sum();
    let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
    let mut sum = 0.0;
    for (value, &weight) in cdf[1..].iter_mut().zip(weights) {
        sum += weight.into();
        *value = (sum * scale).min(1.0) as f32;
    }
    total
}

/// Inverts a distribution function over equal cells of [0, 1] at the value `u`; returns the cell, the
/// position in [0, 1] and the density there.
#[inline]
fn invert(cdf: &[f32], u: f32) -> (usize, f32, f32) {
    let cells = cdf.len() - 1;
    // The last cell that starts at or below `u` has a positive probability for all `u` below 1.
    let above = cdf.partition_point(|&c| c <= u);
    let cell = above.saturating_sub(1).min(cells - 1);
    let probability = cdf[cell + 1] - cdf[cell];
    let within = if probability > 0.0 { ((u - cdf[cell]) / probability).min(1.0) } else { 0.0 };
    (cell, (cell as f32 + within) / cells as f32, probability * cells as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> impl Iterator<Item = Vec2> {
        let at = move |i: usize| (i as f32 + 0.5) / n as f32;
        (0..n * n).map(move |i| Vec2::new(at(i % n), at(i / n)))
    }

    #[test]
    fn points_fall_into_cells_in_proportion_to_the_weights() {
        let weights = [0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 4.0, 0.0, 8.0];
        let distribution = PiecewiseConstant2d::new(3, &weights).unwrap();
        let n = 512;
        let mut counts = [0.0; 9];
        for u in grid(n) {
            let (p, density) = distribution.sample(u);
            assert!((density - distribution.pdf(p)).abs() < 1e-4, "{u} {p}");
            counts[(p.y * 3.0) as usize * 3 + (p.x * 3.0) as usize] += 1.0 / (n * n) as f32;
        }
        for (count, weight) in counts.iter().zip(weights) {
            assert!((count - weight / 16.0).abs() < 4e-3, "{counts:?}");
        }
    }

    #[test]
    fn the_density_integrates_to_one() {
        let weights: Vec<f32> = (0..35).map(|i| (i * i % 11) as f32).collect();
        let distribution = PiecewiseConstant2d::new(7, &weights).unwrap();
        let n = 210;
        let integral: f64 = grid(n).map(|p| f64::from(distribution.pdf(p))).sum::<f64>() / (n * n) as f64;
        assert!((integral - 1.0).abs() < 1e-5, "{integral}");
    }

    #[test]
    fn weights_of_zero_have_no_distribution() {
        assert!(PiecewiseConstant2d::new(2, &[0.0; 4]).is_none());
        assert!(PiecewiseConstant2d::new(0, &[]).is_none());
    }
}
