//! Tables of quantities of a rough dielectric interface by angle, roughness and index of refraction.

use super::clamp::clamp_or_zero;

/// Nodes along the three axes. The error of the reflectances in [`super::coat`] is below 0.005, except within a few
/// degrees of the horizon for alpha < 0.02 or eta < 1.05.
const COSINES: usize = 32;
const ALPHAS: usize = 16;
const ETAS: usize = 12;

/// Largest index of refraction tabulated.
pub(super) const MAX_ETA: f32 = 3.0;

/// A function of cos in [0, 1], alpha in [0, 1] and eta in [1, [`MAX_ETA`]], interpolated linearly between nodes that
/// are denser towards the lower bounds.
pub(super) struct InterfaceTable {
    /// `[eta][alpha][cosine]`
    values: Vec<f32>,
    /// `[eta][alpha]`: averages over cosine-weighted directions.
    means: Vec<f32>,
}

/// A place between the rows of a table, for one roughness and index of refraction.
#[derive(Clone, Copy, Debug)]
pub(super) struct InterfaceRow {
    /// Index of the row below in alpha and eta.
    first: usize,
    /// Fractions of the way to the next alpha and to the next eta.
    to_alpha: f32,
    to_eta: f32,
}

impl InterfaceRow {
    pub fn new(alpha: f32, eta: f32) -> Self {
        let (a, to_alpha) = locate(alpha.max(0.0).sqrt(), ALPHAS);
        let (e, to_eta) = locate(((eta - 1.0) / (MAX_ETA - 1.0)).max(0.0).sqrt(), ETAS);
        Self { first: e * ALPHAS + a, to_alpha, to_eta }
    }

    /// Interpolates the values of the four rows around.
    #[inline]
    fn interpolate(self, value: impl Fn(usize) -> f32) -> f32 {
        let along_alpha = |row: usize| lerp(value(row), value(row + 1), self.to_alpha);
        lerp(along_alpha(self.first), along_alpha(self.first + ALPHAS), self.to_eta)
    }
}

/// Index of the node below a coordinate in [0, 1], and the fraction of the way to the next.
fn locate(coordinate: f32, nodes: usize) -> (usize, f32) {
    let x = clamp_or_zero(coordinate, 1.0) * (nodes - 1) as f32;
    let node = (x as usize).min(nodes - 2);
    (node, x - node as f32)
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

impl InterfaceTable {
    /// Tabulates `f(cos, alpha, eta)`, with the first nodes of cos and alpha slightly above 0.
    pub fn new(f: impl Fn(f32, f32, f32) -> f32) -> Self {
        const MIN: f32 = 1e-3;
        let square = |i: usize, nodes: usize| (i as f32 / (nodes - 1) as f32).powi(2);
        let mut table = Self {
            values: Vec::with_capacity(COSINES * ALPHAS * ETAS),
            means: Vec::with_capacity(ALPHAS * ETAS),
        };
        for e in 0..ETAS {
            let eta = 1.0 + (MAX_ETA - 1.0) * square(e, ETAS);
            for a in 0..ALPHAS {
                let alpha = square(a, ALPHAS).max(MIN);
                let row = (0..COSINES).map(|c| f(square(c, COSINES).max(MIN), alpha, eta));
                table.values.extend(row);
                table.means.push(mean_of_row(&table.values[table.values.len() - COSINES..]));
            }
        }
        table
    }

    /// The interpolated value.
    #[inline]
    pub fn at(&self, cos: f32, row: InterfaceRow) -> f32 {
        let (c, t) = locate(cos.max(0.0).sqrt(), COSINES);
        row.interpolate(|row| lerp(self.values[row * COSINES + c], self.values[row * COSINES + c + 1], t))
    }

    /// The average over cosine-weighted directions.
    pub fn mean(&self, row: InterfaceRow) -> f32 {
        row.interpolate(|row| self.means[row])
    }
}

/// ∫ f 2 cos dcos over an interpolated row.
fn mean_of_row(row: &[f32]) -> f32 {
    const STEPS: usize = 1024;
    let sum: f32 = (0..STEPS)
        .map(|i| {
            let cos = ((i as f32 + 0.5) / STEPS as f32).sqrt(); // cos² is uniform
            let (c, t) = locate(cos.sqrt(), COSINES);
            lerp(row[c], row[c + 1], t)
        })
        .sum();
    sum / STEPS as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_that_are_linear_between_the_nodes_are_exact() {
        let table =
            InterfaceTable::new(|cos, alpha, eta| cos.sqrt() + 2.0 * alpha.sqrt() + (eta - 1.0).sqrt());
        for (cos, alpha, eta) in [(0.3, 0.41, 1.5), (1.0, 1.0, 3.0), (0.05, 0.2, 2.2)] {
            let exact = f32::sqrt(cos) + 2.0 * f32::sqrt(alpha) + f32::sqrt(eta - 1.0);
            assert!((table.at(cos, InterfaceRow::new(alpha, eta)) - exact).abs() < 1e-5);
        }
        // ∫ √cos 2 cos dcos = 4/5
        assert!((table.mean(InterfaceRow::new(0.25, 1.0)) - 1.8).abs() < 1e-3);
    }

    #[test]
    fn arguments_are_clamped_to_the_range_of_the_table() {
        let table = InterfaceTable::new(|cos, _, eta| cos + eta);
        let at = |cos, alpha, eta| table.at(cos, InterfaceRow::new(alpha, eta));
        assert_eq!(at(2.0, 0.5, 9.0), 4.0);
        assert_eq!(at(f32::NAN, f32::NAN, 1.0), at(0.0, 0.0, 1.0));
    }
}
