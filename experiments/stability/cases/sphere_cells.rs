//! Divides the sphere into cells of equal solid angle, to count directions and integrate densities.

use std::f32::consts::TAU;

use glam::Vec3;

/// Cells of equal solid angle.
pub struct SphereCells;

impl SphereCells {
    const ROWS: usize = 24;
    const COLUMNS: usize = 24;
    /// Quadrature nodes along each side of a cell. Densities are discontinuous at outlines: with 16 nodes the
    /// quadrature's error there exceeds the noise of a million samples.
    const NODES: usize = 40;
    /// Number of cells.
    pub const COUNT: usize = Self::ROWS * Self::COLUMNS;

    /// Index of the cell of a direction.
    pub fn index(w: Vec3) -> usize {
        let row = ((0.5 * (w.z + 1.0) * Self::ROWS as f32) as usize).min(Self::ROWS - 1);
        let phi = w.y.atan2(w.x) / TAU + 0.5;
        row * Self::COLUMNS + ((phi * Self::COLUMNS as f32) as usize).min(Self::COLUMNS - 1)
    }

    /// Integrates a density over each cell.
    pub fn integrate(pdf: impl Fn(Vec3) -> f32) -> Vec<f64> {
        let mut mass = vec![0.0; Self::COUNT];
        let (rows, columns) = (Self::ROWS * Self::NODES, Self::COLUMNS * Self::NODES);
        let area = 2.0 * std::f64::consts::TAU / (rows * columns) as f64;
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let z = (2 * row + 1) as f32 / rows as f32 - 1.0;
            let phi = TAU * ((column as f32 + 0.5) / columns as f32 - 0.5);
            let ring = (1.0 - z * z).sqrt();
            let w = Vec3::new(ring * phi.cos(), ring * phi.sin(), z);
            mass[row / Self::NODES * Self::COLUMNS + column / Self::NODES] += f64::from(pdf(w)) * area;
        }
        mass
    }
}
