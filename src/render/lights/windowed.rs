//! A piecewise-constant density over the unit square of which any upright window can be sampled
//! by itself: sums over all cells below and left of each (a summed-area table) give the
//! distribution functions of the window (Bitterli, Novák and Jarosz 2015).

use glam::DVec2;

/// An upright rectangle in the unit square.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    pub min: DVec2,
    pub max: DVec2,
}

impl Window {
    pub fn contains(&self, point: DVec2) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub struct WindowedDistribution {
    /// Cells along a side.
    size: usize,
    /// For each of (`size` + 1)² corners of cells the sum of the weights below and left of it.
    sums: Vec<f64>,
}

impl WindowedDistribution {
    /// Density in proportion to `weights`, `size` rows of as many; non-negative and finite.
    pub fn new(size: usize, weights: &[f32]) -> Self {
        let mut sums = vec![0.0; (size + 1) * (size + 1)];
        for (y, row) in weights.chunks_exact(size).enumerate() {
            let mut sum_of_row = 0.0;
            for (x, &weight) in row.iter().enumerate() {
                sum_of_row += f64::from(weight);
                sums[(y + 1) * (size + 1) + x + 1] = sums[y * (size + 1) + x + 1] + sum_of_row;
            }
        }
        Self { size, sums }
    }

    /// A point of the window and its density there; `None` if the window has no weight.
    pub fn sample(&self, window: &Window, u: DVec2) -> Option<(DVec2, f64)> {
        let Window { min, max } = *window;
        let up_to = |x: f64| self.sum(DVec2::new(x, max.y)) - self.sum(DVec2::new(x, min.y));
        let x = self.invert([min.x, max.x], up_to, u.x);
        // All of the column's cell: the density does not change across it.
        let column = self.cell(x) as f64;
        let [left, right] = [column, column + 1.0].map(|x| x / self.size as f64);
        let up_to = |y: f64| self.sum(DVec2::new(right, y)) - self.sum(DVec2::new(left, y));
        let point = DVec2::new(x, self.invert([min.y, max.y], up_to, u.y));
        let density = self.density(window, point);
        (density > 0.0).then_some((point, density))
    }

    /// Density with which [`Self::sample`] gives a point of the window; 0 for other points.
    pub fn density(&self, window: &Window, point: DVec2) -> f64 {
        let Window { min, max } = *window;
        if !window.contains(point) {
            return 0.0;
        }
        let corners = [max, DVec2::new(min.x, max.y), DVec2::new(max.x, min.y), min];
        let [whole, left, below, both] = corners.map(|corner| self.sum(corner));
        let in_window = whole - left - below + both;
        let density = self.weight(point) * (self.size * self.size) as f64 / in_window;
        if density.is_finite() { density.max(0.0) } else { 0.0 }
    }

    fn cell(&self, at: f64) -> usize {
        ((at * self.size as f64) as usize).min(self.size - 1)
    }

    /// Weight of the cell that a point is in.
    fn weight(&self, point: DVec2) -> f64 {
        let (x, y) = (self.cell(point.x), self.cell(point.y));
        self.corner(x + 1, y + 1) - self.corner(x, y + 1) - self.corner(x + 1, y) + self.corner(x, y)
    }

    /// Sum of the weights below and left of a point.
    fn sum(&self, point: DVec2) -> f64 {
        let (x, y) = (self.cell(point.x), self.cell(point.y));
        let share = point * self.size as f64 - DVec2::new(x as f64, y as f64);
        let along = |y| self.corner(x, y) * (1.0 - share.x) + self.corner(x + 1, y) * share.x;
        along(y) * (1.0 - share.y) + along(y + 1) * share.y
    }

    fn corner(&self, x: usize, y: usize) -> f64 {
        self.sums[y * (self.size + 1) + x]
    }

    /// Where in a range a function that rises in straight lines, each across a cell, has made
    /// the share `u` of its way.
    fn invert(&self, [start, end]: [f64; 2], rising: impl Fn(f64) -> f64, u: f64) -> f64 {
        let size = self.size as f64;
        let border = |i: usize| (i as f64 / size).clamp(start, end);
        let value = rising(start) * (1.0 - u) + rising(end) * u;
        let (mut low, mut high) = ((start * size) as usize, (end * size).ceil() as usize);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if rising(border(middle)) <= value {
                low = middle;
            } else {
                high = middle;
            }
        }
        let (a, b) = (border(low), border(high));
        let (from, to) = (rising(a), rising(b));
        let share = if to > from { ((value - from) / (to - from)).clamp(0.0, 1.0) } else { 0.5 };
        a + (b - a) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOWS: [Window; 4] = [
        Window { min: DVec2::ZERO, max: DVec2::ONE },
        Window { min: DVec2::new(0.1, 0.35), max: DVec2::new(0.73, 0.9) },
        // Within one cell, and along a border of cells.
        Window { min: DVec2::new(0.26, 0.51), max: DVec2::new(0.3, 0.6) },
        Window { min: DVec2::new(0.25, 0.0), max: DVec2::new(0.5, 1.0) },
    ];

    fn distribution() -> WindowedDistribution {
        let weights = [0.0, 1.0, 3.0, 0.0, 0.0, 5.0, 4.0, 0.5, 8.0, 1.0, 0.0, 2.0, 0.1, 0.2, 0.3, 9.0];
        WindowedDistribution::new(4, &weights)
    }

    fn grid(n: usize) -> impl Iterator<Item = DVec2> {
        let at = move |i: usize| (i as f64 + 0.5) / n as f64;
        (0..n * n).map(move |i| DVec2::new(at(i % n), at(i / n)))
    }

    #[test]
    fn the_density_of_a_window_integrates_to_one_and_is_zero_beyond_it() {
        let distribution = distribution();
        for window in WINDOWS {
            let n = 1000;
            let sum: f64 = grid(n).map(|p| distribution.density(&window, p)).sum();
            assert!((sum / (n * n) as f64 - 1.0).abs() < 0.02, "{window:?}: {sum}");
            let beyond = [window.min - 1e-9, window.max + 1e-9];
            assert_eq!(beyond.map(|p| distribution.density(&window, p)), [0.0; 2]);
        }
    }

    #[test]
    fn even_numbers_give_points_as_dense_as_the_density_says() {
        let distribution = distribution();
        for window in WINDOWS {
            // Share of the points in each of 12×12 parts of the window, against the density in it.
            let parts = 12;
            let (n, size) = (480, window.max - window.min);
            let mut shares = vec![0.0; parts * parts];
            for u in grid(n) {
                let (p, density) = distribution.sample(&window, u).unwrap();
                assert!(window.contains(p) && density > 0.0);
                let at = (p - window.min) / size * parts as f64;
                let [x, y] = [at.x, at.y].map(|x| (x as usize).min(parts - 1));
                shares[y * parts + x] += 1.0 / (n * n) as f64;
            }
            let mut expected = vec![0.0; parts * parts];
            for (i, at) in grid(30 * parts).enumerate() {
                let (x, y) = (i % (30 * parts) / 30, i / (30 * parts) / 30);
                let area = size.x * size.y / (30 * parts).pow(2) as f64;
                expected[y * parts + x] += distribution.density(&window, window.min + at * size) * area;
            }
            for (share, expected) in shares.iter().zip(&expected) {
                assert!((share - expected).abs() < 1.5e-3, "{window:?}: {share} {expected}");
            }
        }
    }

    #[test]
    fn a_window_without_weight_has_no_points() {
        let dark = Window { min: DVec2::new(0.05, 0.05), max: DVec2::new(0.2, 0.45) };
        let weights = [0.0, 1.0, 0.0, 1.0];
        assert!(WindowedDistribution::new(2, &weights).sample(&dark, DVec2::splat(0.5)).is_none());
    }
}
