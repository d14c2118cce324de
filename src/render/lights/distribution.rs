//! A piecewise-constant density over the unit square, sampled by inverting its marginal and
//! conditional distribution functions (pbrt-v4, section A.5.2). Neighbouring numbers give
//! neighbouring points, so that stratification survives.

use glam::Vec2;

/// See the module.
#[derive(Clone, Debug)]
pub struct Distribution2d {
    width: usize,
    /// Distribution function over rows: `height + 1` values from 0 to 1.
    rows: Vec<f32>,
    /// For each row, the distribution function over its cells: `width + 1` values from 0 to 1.
    cells: Vec<f32>,
}

impl Distribution2d {
    /// Density in proportion to `weights`, row by row, non-negative and finite; `None` if all are 0.
    pub fn new(width: usize, weights: &[f32]) -> Option<Self> {
        if width == 0 {
            return None;
        }
        let mut cells = Vec::with_capacity(weights.len() / width * (width + 1));
        let sums: Vec<f64> = weights.chunks_exact(width).map(|row| append_cdf(&mut cells, row)).collect();
        let mut rows = Vec::with_capacity(sums.len() + 1);
        let total = append_cdf(&mut rows, &sums);
        (total > 0.0).then_some(Self { width, rows, cells })
    }

    fn height(&self) -> usize {
        self.rows.len() - 1
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.cells[y * (self.width + 1)..][..self.width + 1]
    }

    /// A point in the unit square and its density.
    #[inline]
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let (row, y, density_y) = invert(&self.rows, u.y);
        let (_, x, density_x) = invert(self.row(row), u.x);
        (Vec2::new(x, y), density_x * density_y)
    }

    /// Density at a point of the unit square.
    #[inline]
    pub fn density(&self, point: Vec2) -> f32 {
        let cell = |t: f32, n: usize| ((t * n as f32) as usize).min(n - 1);
        let y = cell(point.y, self.height());
        let x = cell(point.x, self.width);
        let row = self.row(y);
        (row[x + 1] - row[x]) * (self.rows[y + 1] - self.rows[y]) * (self.width * self.height()) as f32
    }
}

/// Appends the normalised distribution function of `weights` (all 0 if they are) and returns their
/// sum.
fn append_cdf<T: Copy + Into<f64>>(cdf: &mut Vec<f32>, weights: &[T]) -> f64 {
    let total: f64 = weights.iter().map(|&w| w.into()).sum();
    let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
    let mut sum = 0.0;
    cdf.push(0.0);
    cdf.extend(weights.iter().map(|&w| {
        sum += w.into();
        (sum * scale).min(1.0) as f32
    }));
    total
}

/// Where a distribution function over equal cells of [0, 1] takes the value `u`: the cell, the
/// place and the density there.
#[inline]
fn invert(cdf: &[f32], u: f32) -> (usize, f32, f32) {
    let cells = cdf.len() - 1;
    // The last cell that starts at or below u: never one of probability 0, for `u` below the end.
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
        let distribution = Distribution2d::new(3, &weights).unwrap();
        let n = 512;
        let mut counts = [0.0; 9];
        for u in grid(n) {
            let (p, density) = distribution.sample(u);
            assert!((density - distribution.density(p)).abs() < 1e-4, "{u} {p}");
            counts[(p.y * 3.0) as usize * 3 + (p.x * 3.0) as usize] += 1.0 / (n * n) as f32;
        }
        for (count, weight) in counts.iter().zip(weights) {
            assert!((count - weight / 16.0).abs() < 4e-3, "{counts:?}");
        }
    }

    #[test]
    fn the_density_integrates_to_one() {
        let weights: Vec<f32> = (0..35).map(|i| (i * i % 11) as f32).collect();
        let distribution = Distribution2d::new(7, &weights).unwrap();
        let n = 210;
        let integral: f64 = grid(n).map(|p| f64::from(distribution.density(p))).sum::<f64>() / (n * n) as f64;
        assert!((integral - 1.0).abs() < 1e-5, "{integral}");
    }

    #[test]
    fn there_is_no_distribution_without_weight() {
        assert!(Distribution2d::new(2, &[0.0; 4]).is_none());
        assert!(Distribution2d::new(0, &[]).is_none());
    }
}
