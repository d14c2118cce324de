//! The sparse grid: pixels at which weights are computed, and which of them surround a pixel.

/// Nodes along each axis that surround a pixel.
const SIDE: usize = 4;

/// Nodes that surround a pixel.
pub const NODES: usize = SIDE * SIDE;

/// A grid of nodes: every `spacing`-th pixel along both axes, at the centre of its cell.
pub struct Grid {
    spacing: usize,
    xs: Vec<usize>,
    ys: Vec<usize>,
}

impl Grid {
    pub fn new(width: usize, height: usize, spacing: usize) -> Self {
        let spacing = spacing.max(1);
        let axis = |size: usize| {
            (0..size).step_by(spacing).map(|start| (start + spacing / 2).min(size - 1)).collect()
        };
        Self { spacing, xs: axis(width), ys: axis(height) }
    }

    /// Returns the pixels of all nodes, row by row.
    pub fn nodes(&self) -> Vec<(usize, usize)> {
        (0..self.xs.len() * self.ys.len()).map(|node| self.node(node)).collect()
    }

    /// Returns the pixel of a node.
    pub fn node(&self, node: usize) -> (usize, usize) {
        (self.xs[node % self.xs.len()], self.ys[node / self.xs.len()])
    }

    /// Returns the block of a pixel: along each axis, the number of nodes at or before it. Pixels of one
    /// block have the same surrounding nodes.
    #[inline]
    pub fn block(&self, (x, y): (usize, usize)) -> (usize, usize) {
        (self.block_along(&self.xs, x), self.block_along(&self.ys, y))
    }

    #[inline]
    fn block_along(&self, nodes: &[usize], at: usize) -> usize {
        ((at + self.spacing - self.spacing / 2) / self.spacing).min(nodes.len())
    }

    /// Returns the nodes that surround the pixels of a block, two to each side along both axes; `None`
    /// outside the grid.
    #[inline]
    pub fn surrounding(&self, (bx, by): (usize, usize)) -> [Option<usize>; NODES] {
        std::array::from_fn(|n| {
            let x = (bx + n % SIDE).checked_sub(SIDE / 2).filter(|&x| x < self.xs.len())?;
            let y = (by + n / SIDE).checked_sub(SIDE / 2).filter(|&y| y < self.ys.len())?;
            Some(y * self.xs.len() + x)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_lie_at_the_centre_of_every_cell_and_inside_the_image() {
        let grid = Grid::new(12, 1, 5);
        assert_eq!(grid.nodes(), [(2, 0), (7, 0), (11, 0)]);
        assert_eq!(Grid::new(1, 1, 5).nodes(), [(0, 0)]);
        assert_eq!(Grid::new(3, 3, 1).nodes().len(), 9);
    }

    #[test]
    fn surrounding_nodes_are_the_nearest_along_each_axis() {
        let grid = Grid::new(100, 100, 5);
        for (x, expected) in [(50, [42, 47, 52, 57]), (52, [47, 52, 57, 62]), (51, [42, 47, 52, 57])] {
            let nodes = grid.surrounding(grid.block((x, 50)));
            let xs = nodes[..SIDE].iter().map(|node| grid.node(node.expect("inside")).0);
            assert!(xs.eq(expected), "{x}");
        }
        // At a corner, only those inside the grid
        let nodes = grid.surrounding(grid.block((0, 0)));
        let inside: Vec<_> = nodes.into_iter().flatten().map(|node| grid.node(node)).collect();
        assert_eq!(inside, [(2, 2), (7, 2), (2, 7), (7, 7)]);
    }
}
