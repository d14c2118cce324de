//! Divides an image into rectangles of about equal cost, one for each process, by recursive bisection of its tiles.
//!
//! Rectangles have short borders for their area, and a process knows its pixels by four numbers.

use crate::stats::{PIXEL_BLOCK, Rectangle};

/// Side of the tiles that are not divided, in pixels.
pub const TILE: usize = PIXEL_BLOCK;

/// The cost of each tile of an image.
#[derive(Clone, Debug)]
pub struct TileCosts {
    width: usize,
    height: usize,
    /// Row by row.
    costs: Vec<f64>,
}

impl TileCosts {
    /// Gives all tiles of an image, whose size is in pixels, the same cost.
    pub fn uniform(width: usize, height: usize, cost: f64) -> Self {
        let tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
        Self { width, height, costs: vec![cost; tiles] }
    }

    /// Returns the costs times the sums of a plane of counts, one for each pixel, over the tiles.
    pub fn times_counts(&self, counts: &[u32]) -> Self {
        let columns = self.columns();
        let mut sums = vec![0_u64; self.costs.len()];
        for (i, &count) in counts.iter().enumerate() {
            sums[i / self.width / TILE * columns + i % self.width / TILE] += u64::from(count);
        }
        let costs = self.costs.iter().zip(sums).map(|(cost, sum)| cost * sum as f64).collect();
        Self { costs, ..*self }
    }

    /// Returns the number of tiles.
    pub fn len(&self) -> usize {
        self.costs.len()
    }

    /// Returns the cost of the tiles of a rectangle of [`Self::partition`].
    pub fn cost_in(&self, rectangle: &Rectangle) -> f64 {
        self.tiles(rectangle).map(|i| self.costs[i]).sum()
    }

    /// Multiplies the costs of a rectangle's tiles.
    pub fn scale(&mut self, rectangle: &Rectangle, factor: f64) {
        let tiles: Vec<usize> = self.tiles(rectangle).collect();
        tiles.into_iter().for_each(|i| self.costs[i] *= factor);
    }

    /// Divides the image into as many rectangles, of about equal cost and of whole tiles.
    ///
    /// # Panics
    /// If there are more parts than tiles, or none.
    pub fn partition(&self, parts: usize) -> Vec<Rectangle> {
        assert!((1..=self.len()).contains(&parts), "from one part to one for each tile");
        let mut rectangles = Vec::with_capacity(parts);
        let tiles = Rectangle::whole(self.columns(), self.height.div_ceil(TILE));
        self.bisect(tiles, parts, &mut rectangles);
        let pixels = |tiles: [usize; 2], end: usize| tiles.map(|tile| (tile * TILE).min(end));
        rectangles
            .iter()
            .map(|r| Rectangle { x: pixels(r.x, self.width), y: pixels(r.y, self.height) })
            .collect()
    }

    /// Divides a rectangle of tiles across its longer side.
    fn bisect(&self, tiles: Rectangle, parts: usize, rectangles: &mut Vec<Rectangle>) {
        if parts == 1 {
            rectangles.push(tiles);
            return;
        }
        let is_wide = tiles.width() >= tiles.height();
        let (side, across) =
            if is_wide { (tiles.width(), tiles.height()) } else { (tiles.height(), tiles.width()) };
        let split = |at: usize| {
            let (mut first, mut second) = (tiles, tiles);
            let (end, start) = if is_wide {
                (&mut first.x[1], &mut second.x[0])
            } else {
                (&mut first.y[1], &mut second.y[0])
            };
            let edge = at + if is_wide { tiles.x[0] } else { tiles.y[0] };
            (*end, *start) = (edge, edge);
            (first, second)
        };
        // Both sides keep a tile for each of their parts, if need be with other numbers of parts
        let mut first_parts = parts / 2;
        let (mut least, mut most) =
            (first_parts.div_ceil(across), side - (parts - first_parts).div_ceil(across));
        if least > most {
            (least, most) = (side / 2, side / 2);
            first_parts = least * across;
        }
        let cost = |tiles: Rectangle| self.tile_indices(tiles).map(|i| self.costs[i]).sum::<f64>();
        let wanted = cost(tiles) * first_parts as f64 / parts as f64;
        let error = |at: usize| (cost(split(at).0) - wanted).abs();
        let best = (least..=most).min_by(|&a, &b| error(a).total_cmp(&error(b))).unwrap_or(least);
        let (first, second) = split(best);
        self.bisect(first, first_parts, rectangles);
        self.bisect(second, parts - first_parts, rectangles);
    }

    fn columns(&self) -> usize {
        self.width.div_ceil(TILE)
    }

    /// Returns the indices of the tiles of a rectangle of pixels.
    fn tiles(&self, pixels: &Rectangle) -> impl Iterator<Item = usize> + use<> {
        let tiles = |[start, end]: [usize; 2]| [start / TILE, end.div_ceil(TILE)];
        self.tile_indices(Rectangle { x: tiles(pixels.x), y: tiles(pixels.y) })
    }

    fn tile_indices(&self, tiles: Rectangle) -> impl Iterator<Item = usize> + use<> {
        let (Rectangle { x: [x0, x1], y: [y0, y1] }, columns) = (tiles, self.columns());
        (y0..y1).flat_map(move |y| y * columns + x0..y * columns + x1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_cover_every_pixel_once() {
        for (width, height, parts) in
            [(100, 50, 1), (100, 50, 7), (16, 16, 1), (160, 16, 10), (37, 61, 12), (33, 40, 9)]
        {
            let costs = TileCosts::uniform(width, height, 1.0);
            let rectangles = costs.partition(parts);
            assert_eq!(rectangles.len(), parts);
            let mut owners = vec![0; width * height];
            for rectangle in &rectangles {
                assert!(rectangle.pixels() > 0 && rectangle.x[0] % TILE == 0 && rectangle.y[0] % TILE == 0);
                for y in rectangle.y[0]..rectangle.y[1] {
                    (rectangle.x[0]..rectangle.x[1]).for_each(|x| owners[y * width + x] += 1);
                }
            }
            assert!(owners.iter().all(|&n| n == 1), "{width}x{height} {parts}: {rectangles:?}");
        }
    }

    #[test]
    fn parts_have_about_equal_costs() {
        let (width, height) = (1920, 1080);
        // One quarter of the image gets nine times the samples of the others.
        let counts: Vec<u32> = (0..width * height).map(|i| if i % width < 480 { 9 } else { 1 }).collect();
        let costs = TileCosts::uniform(width, height, 2.0).times_counts(&counts);
        let all: f64 = 2.0 * counts.iter().map(|&n| f64::from(n)).sum::<f64>();
        for parts in [2, 3, 8, 64] {
            let largest = costs.partition(parts).iter().map(|r| costs.cost_in(r)).fold(0.0, f64::max);
            assert!(largest < 1.15 * all / parts as f64, "{parts}: {largest} of {all}");
        }
    }

    #[test]
    fn measured_costs_shrink_the_slow_part() {
        let mut costs = TileCosts::uniform(160, 160, 1.0);
        let before = costs.partition(2);
        costs.scale(&before[0], 4.0);
        let after = costs.partition(2);
        assert!(after[0].pixels() < before[0].pixels());
        assert!((costs.cost_in(&after[0]) / costs.cost_in(&after[1]) - 1.0).abs() < 0.3);
    }
}
