//! A piecewise-constant density over the unit square, sampled within any axis-aligned window of it
//! (`WindowedPiecewiseConstant2D` in pbrt-v4, section A.5).
//!
//! A summed-area table of the weights gives the distribution functions of the window (Bitterli, Novák and
//! Jarosz, *Portal-Masked Environment Map Sampling*, 2015).

use glam::DVec2;

/// An axis-aligned rectangle in the unit square.
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

/// A piecewise-constant density over a square grid of cells.
#[derive(Clone, Debug)]
pub struct WindowedPiecewiseConstant2d {
    /// Number of cells along a side.
    size: usize,
    /// For each of (`size` + 1)² corners of cells the sum of the weights below and left of it.
    sums: Vec<f64>,
}

impl WindowedPiecewiseConstant2d {
    /// A density in proportion to `weights`: `size` rows of `size` weights, non-negative and finite.
    pub fn new(size: usize, weights: &[f32]) -> Self {
        let mut sums = vec![0.0; (size + 1) * (size + 1)];
        for (y, row) in weights.chunks_exact(size).enumerate() {
            let mut row_sum = 0.0;
            for (x, &weight) in row.iter().enumerate() {
                row_sum += f64::from(weight);
                sums[(y + 1) * (size + 1) + x + 1] = sums[y * (size + 1) + x + 1] + row_sum;
            }
        }
        Self { size, sums }
    }

    /// Maps `u` in [0, 1)² to a point of the window and returns it with its density in the window; `None` if
    /// the window's weights are 0.
    pub fn sample(&self, window: &Window, u: DVec2) -> Option<(DVec2, f64)> {
        let Window { min, max } = *window;
        let marginal = |x: f64| self.sum(DVec2::new(x, max.y)) - self.sum(DVec2::new(x, min.y));
        let x = self.invert([min.x, max.x], marginal, u.x);
        // The whole width of the cell, since the density is constant across it.
        let column = self.cell(x) as f64;
        let [left, right] = [column, column + 1.0].map(|x| x / self.size as f64);
        let conditional = |y: f64| self.sum(DVec2::new(right, y)) - self.sum(DVec2::new(left, y));
        let point = DVec2::new(x, self.invert([min.y, max.y], conditional, u.y));
        let density = self.pdf(window, point);
        (density > 0.0).then_some((point, density))
    }

    /// Density with which [`Self::sample`] samples a point of the window; 0 for other points.
    pub fn pdf(&self, window: &Window, point: DVec2) -> f64 {
        let Window { min, max } = *window;
        if !window.contains(point) {
            return 0.0;
        }
        let corners = [max, DVec2::new(min.x, max.y), DVec2::new(max.x, min.y), min];
        let [whole, left, below, both] = corners.map(|corner| self.sum(corner));
        let window_sum = whole - left - below + both;
        let density = self.weight(point) * (self.size * self.size) as f64 / window_sum;
        if density.is_finite() { density.max(0.0) } else { 0.0 }
    }

    /// Index of the cell at a coordinate in [0, 1].
    fn cell(&self, x: f64) -> usize {
        ((x * self.size as f64) as usize).min(self.size - 1)
    }

    /// Weight of the cell that contains a point.
    fn weight(&self, point: DVec2) -> f64 {
        let (x, y) = (self.cell(point.x), self.cell(point.y));
        self.corner(x + 1, y + 1) - self.corner(x, y + 1) - self.corner(x + 1, y) + self.corner(x, y)
    }

    /// Sum of the weights below and left of a point.
    fn sum(&self, point: DVec2) -> f64 {
        let (x, y) = (self.cell(point.x), self.cell(point.y));
        let t = point * self.size as f64 - DVec2::new(x as f64, y as f64);
        let lerp_x = |y| self.corner(x, y) * (1.0 - t.x) + self.corner(x + 1, y) * t.x;
        lerp_x(y) * (1.0 - t.y) + lerp_x(y + 1) * t.y
    }

    fn corner(&self, x: usize, y: usize) -> f64 {
        self.sums[y * (self.size + 1) + x]
    }

    /// Inverts a non-decreasing function that is linear across each cell: the position in [`start`, `end`]
    /// at which `cdf` has risen by the fraction `u` of its rise over this range.
    fn invert(&self, [start, end]: [f64; 2], cdf: impl Fn(f64) -> f64, u: f64) -> f64 {
        // Find the cell by bisection
        let size = self.size as f64;
        let border = |i: usize| (i as f64 / size).clamp(start, end);
        let value = cdf(start) * (1.0 - u) + cdf(end) * u;
        let (mut low, mut high) = ((start * size) as usize, (end * size).ceil() as usize);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if cdf(border(middle)) <= value {
                low = middle;
            } else {
                high = middle;
            }
        }

        // Invert the linear function across the cell
        let (a, b) = (border(low), border(high));
        let (cdf_a, cdf_b) = (cdf(a), cdf(b));
        let t = if cdf_b > cdf_a { ((value - cdf_a) / (cdf_b - cdf_a)).clamp(0.0, 1.0) } else { 0.5 };
        a + (b - a) * t
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

    fn distribution() -> WindowedPiecewiseConstant2d {
        let weights = [0.0, 1.0, 3.0, 0.0, 0.0, 5.0, 4.0, 0.5, 8.0, 1.0, 0.0, 2.0, 0.1, 0.2, 0.3, 9.0];
        WindowedPiecewiseConstant2d::new(4, &weights)
    }

    fn grid(n: usize) -> impl Iterator<Item = DVec2> {
        let at = move |i: usize| (i as f64 + 0.5) / n as f64;
        (0..n * n).map(move |i| DVec2::new(at(i % n), at(i / n)))
    }

    #[test]
    fn the_density_of_a_window_integrates_to_one_and_is_zero_outside() {
        let distribution = distribution();
        for window in WINDOWS {
            let n = 1000;
            let sum: f64 = grid(n).map(|p| distribution.pdf(&window, p)).sum();
            assert!((sum / (n * n) as f64 - 1.0).abs() < 0.02, "{window:?}: {sum}");
            let outside = [window.min - 1e-9, window.max + 1e-9];
            assert_eq!(outside.map(|p| distribution.pdf(&window, p)), [0.0; 2]);
        }
    }

    #[test]
    fn samples_follow_the_density() {
        let distribution = distribution();
        for window in WINDOWS {
            // Fraction of the points in each of 12×12 bins of the window, against the integral of the density.
            let bins = 12;
            let (n, size) = (480, window.max - window.min);
            let mut fractions = vec![0.0; bins * bins];
            for u in grid(n) {
                let (p, density) = distribution.sample(&window, u).unwrap();
                assert!(window.contains(p) && density > 0.0);
                let at = (p - window.min) / size * bins as f64;
                let [x, y] = [at.x, at.y].map(|x| (x as usize).min(bins - 1));
                fractions[y * bins + x] += 1.0 / (n * n) as f64;
            }
            let mut expected = vec![0.0; bins * bins];
            for (i, at) in grid(30 * bins).enumerate() {
                let (x, y) = (i % (30 * bins) / 30, i / (30 * bins) / 30);
                let area = size.x * size.y / (30 * bins).pow(2) as f64;
                expected[y * bins + x] += distribution.pdf(&window, window.min + at * size) * area;
            }
            for (fraction, expected) in fractions.iter().zip(&expected) {
                assert!((fraction - expected).abs() < 1.5e-3, "{window:?}: {fraction} {expected}");
            }
        }
    }

    #[test]
    fn a_window_of_zero_weight_has_no_samples() {
        let dark = Window { min: DVec2::new(0.05, 0.05), max: DVec2::new(0.2, 0.45) };
        let weights = [0.0, 1.0, 0.0, 1.0];
        assert!(WindowedPiecewiseConstant2d::new(2, &weights).sample(&dark, DVec2::splat(0.5)).is_none());
    }
}
