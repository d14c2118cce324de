//! Triangles of a rectangular grid.

/// The triangles of a grid of `rows` by `columns` cells, two for each cell.
///
/// Vertices are numbered along the columns first. The front side is that of (column direction) ×
/// (row direction).
pub fn grid_triangles(rows: u32, columns: u32) -> Vec<[u32; 3]> {
    let cell = |row: u32, column: u32| {
        let a = row * (columns + 1) + column;
        let c = a + columns + 1;
        [[a, a + 1, c + 1], [a, c + 1, c]]
    };
    (0..rows).flat_map(|row| (0..columns).flat_map(move |column| cell(row, column))).collect()
}

/// Most triangles that a shape may expand to.
pub const MAX_TRIANGLES: usize = 1 << 24;
