//! A part of an image that stands for the whole: the middles of 4×4 cells, put together.

use crate::image::Planes;
use crate::stats::{Rectangle, StatisticsExtent, Store};

/// Number of cells side by side.
const CELLS: usize = 4;

/// Images of fewer pixels are taken whole; of larger ones at least as many pixels are taken …
const LEAST_PIXELS: usize = 256 * 256;

/// … and at least this fraction.
const LEAST_FRACTION: f64 = 0.125;

/// Least width and height of the middle of a cell, in pixels: smaller ones are mostly borders.
const LEAST_SIDE: usize = 16;

/// The columns and the rows of an image that are taken, as half-open ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct Excerpt {
    columns: Vec<[usize; 2]>,
    rows: Vec<[usize; 2]>,
}

impl Excerpt {
    /// Chooses the excerpt of an image.
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = (width * height).max(1) as f64;
        let fraction = (excerpt_pixels(pixels) / pixels).sqrt();
        Self { columns: middles(width, fraction), rows: middles(height, fraction) }
    }

    /// Copies the excerpt out of planes.
    pub fn copy_planes(&self, planes: &Planes) -> Planes {
        let mut excerpt = Planes::new(length(&self.columns), length(&self.rows), planes.count());
        for (from, to) in self.blocks() {
            let corner = |rectangle: Rectangle| [rectangle.x[0], rectangle.y[0]];
            excerpt.paste(planes, corner(from), corner(to), [from.width(), from.height()]);
        }
        excerpt
    }

    /// Copies the excerpt out of a store, without sample vectors.
    pub fn copy_store(&self, store: &Store) -> Store {
        let (width, height) = (length(&self.columns), length(&self.rows));
        let mut excerpt = Store::new(width, height, store.layout().clone(), 0, 0);
        for (from, to) in self.blocks() {
            excerpt.copy_rectangle(&to, store, &from, StatisticsExtent::All);
        }
        excerpt
    }

    /// Returns each block of the image, and where it lies in the excerpt.
    fn blocks(&self) -> impl Iterator<Item = (Rectangle, Rectangle)> {
        let placed = |ranges: &[[usize; 2]]| {
            let place = |end: &mut usize, &[start, stop]: &[usize; 2]| {
                let place = [*end, *end + stop - start];
                *end = place[1];
                Some(([start, stop], place))
            };
            ranges.iter().scan(0, place).collect::<Vec<_>>()
        };
        let (columns, rows) = (placed(&self.columns), placed(&self.rows));
        rows.into_iter().flat_map(move |(y, to_y)| {
            let blocks = columns.clone().into_iter();
            blocks.map(move |(x, to_x)| (Rectangle { x, y }, Rectangle { x: to_x, y: to_y }))
        })
    }
}

/// Returns about how many pixels of an image are taken.
pub fn excerpt_pixels(pixels: f64) -> f64 {
    pixels.min((LEAST_FRACTION * pixels).max(LEAST_PIXELS as f64))
}

/// Returns the middles of equal cells along an axis of `size` pixels, which are this fraction of it.
fn middles(size: usize, fraction: f64) -> Vec<[usize; 2]> {
    let length = ((size as f64 * fraction / CELLS as f64).ceil() as usize).max(LEAST_SIDE);
    if length * CELLS >= size {
        return vec![[0, size]];
    }
    let middle = |cell: usize| {
        let [start, end] = [cell, cell + 1].map(|cell| cell * size / CELLS);
        let start = start + (end - start - length) / 2;
        [start, start + length]
    };
    (0..CELLS).map(middle).collect()
}

/// Number of pixels of ranges.
fn length(ranges: &[[usize; 2]]) -> usize {
    ranges.iter().map(|[start, end]| end - start).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Layout, Part};

    #[test]
    fn small_images_are_taken_whole_and_an_eighth_of_large_ones() {
        for (width, height, fraction) in
            [(256, 256, 1.0), (512, 512, 0.25), (3840, 2160, 0.125), (1, 1, 1.0), (0, 0, 1.0)]
        {
            let excerpt = Excerpt::new(width, height);
            let found = (length(&excerpt.columns) * length(&excerpt.rows)) as f64;
            let expected = fraction * (width * height) as f64;
            assert!((found - expected).abs() <= 0.01 * expected, "{width}x{height}: {found}");
            for (ranges, size) in [(&excerpt.columns, width), (&excerpt.rows, height)] {
                let ends = ranges.as_flattened();
                assert!(ends.is_sorted() && ends[ends.len() - 1] <= size, "{ranges:?}");
                assert!(ends[0].abs_diff(size - ends[ends.len() - 1]) <= 1, "in the middle: {ranges:?}");
            }
        }
        // A narrow image is taken whole across.
        assert_eq!(Excerpt::new(40, 20_000).columns, [[0, 40]]);
    }

    #[test]
    fn planes_and_stores_are_taken_alike() {
        let (width, height) = (600, 400);
        let layout = Layout::with_blocks(|_| false);
        let mut store = Store::new(width, height, layout.clone(), 1, 0);
        let value = |x: usize, y: usize| (x * 31 + y * 17) as f32;
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            store.push(x, y, &vec![value(x, y); layout.len()]);
        }
        let excerpt = Excerpt::new(width, height);
        let planes = excerpt.copy_planes(&store.means(Part::Whole, layout.colour()));
        assert_eq!(planes, excerpt.copy_store(&store).means(Part::Whole, layout.colour()));
        assert_eq!(planes.at(1, 0, 0), value(excerpt.columns[0][0], excerpt.rows[0][0]));
    }
}
