//! A rectangle of pixels of an image, and the statistics of its pixels as a store of their own.

use rayon::prelude::*;

use super::store::Store;

/// Columns and rows of an image, half open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Rectangle {
    pub x: [usize; 2],
    pub y: [usize; 2],
}

impl Rectangle {
    /// All pixels of an image.
    pub fn of_image(width: usize, height: usize) -> Self {
        Self { x: [0, width], y: [0, height] }
    }

    pub fn width(&self) -> usize {
        self.x[1] - self.x[0]
    }

    pub fn height(&self) -> usize {
        self.y[1] - self.y[0]
    }

    pub fn pixels(&self) -> usize {
        self.width() * self.height()
    }

    /// Returns the pixels that both rectangles have; `None` if there are none.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let both = |a: [usize; 2], b: [usize; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        let (x, y) = (both(self.x, other.x), both(self.y, other.y));
        (x[0] < x[1] && y[0] < y[1]).then_some(Self { x, y })
    }

    /// Returns the rectangle with a margin on each side, as far as it lies within another one.
    pub fn grown(&self, margin: usize, within: &Self) -> Self {
        let grow = |[start, end]: [usize; 2], bounds: [usize; 2]| {
            [start.saturating_sub(margin).max(bounds[0]), (end + margin).min(bounds[1])]
        };
        Self { x: grow(self.x, within.x), y: grow(self.y, within.y) }
    }

    /// Returns the rectangle in coordinates that count from the corner of another one, which contains it.
    pub fn within(&self, outer: &Self) -> Self {
        Self { x: self.x.map(|x| x - outer.x[0]), y: self.y.map(|y| y - outer.y[0]) }
    }

    /// Returns the rectangle's values of a plane of an image of this width, row by row.
    pub fn select<'a, T>(&self, plane: &'a [T], width: usize) -> impl Iterator<Item = &'a [T]> {
        let Self { x: [x0, x1], y: [y0, y1] } = *self;
        (y0..y1).map(move |y| &plane[y * width + x0..y * width + x1])
    }
}

impl Store {
    /// Copies the statistics of a rectangle of pixels into a store of their own.
    ///
    /// # Panics
    /// If the store does not have all of its pixels.
    pub fn crop(&self, rectangle: &Rectangle) -> Self {
        let mut part = Self::of_part(rectangle, self.layout().clone(), self.capacity(), 0);
        let ([x0, x1], y0) = (rectangle.x, rectangle.y[0]);
        let rows = part.rows_mut().par_iter_mut().zip(&self.rows()[y0..]);
        rows.for_each(|(to, from)| to.copy_pixels(0, from, x0..x1));
        part
    }

    /// Replaces the statistics of a rectangle of pixels by those of a store of them.
    ///
    /// # Panics
    /// If the rectangle is not within the store, or the other store has other sizes or another layout.
    pub fn paste(&mut self, rectangle: &Rectangle, part: &Self) {
        assert!((part.width(), part.height()) == (rectangle.width(), rectangle.height()), "the part's size");
        assert!(part.layout() == self.layout() && part.capacity() == self.capacity(), "the same layout");
        let [y0, y1] = rectangle.y;
        let rows = self.rows_mut()[y0..y1].par_iter_mut().zip(part.rows());
        rows.for_each(|(to, from)| to.copy_pixels(rectangle.x[0], from, 0..part.width()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Block, Layout};

    #[test]
    fn rectangles_intersect_in_the_pixels_of_both() {
        let a = Rectangle { x: [2, 9], y: [0, 5] };
        let b = Rectangle { x: [5, 20], y: [4, 6] };
        assert_eq!(a.intersection(&b), Some(Rectangle { x: [5, 9], y: [4, 5] }));
        assert_eq!(a.intersection(&Rectangle { x: [9, 10], y: [0, 5] }), None);
        assert_eq!((a.width(), a.height(), a.pixels()), (7, 5, 35));
        let plane: Vec<usize> = (0..100).collect();
        let rows: Vec<_> = Rectangle { x: [5, 7], y: [4, 6] }.select(&plane, 10).collect();
        assert_eq!(rows, [[45, 46], [55, 56]]);
    }

    /// Stores cut into parts take samples in as the whole one does.
    #[test]
    fn parts_pasted_together_are_the_whole() {
        let (width, height) = (37, 9);
        for (layout, capacity) in [
            (Layout::with_blocks(|block| block == Block::Normal1), 3),
            (Layout::with_blocks(|_| true).restricted_to([Block::Normal1].into_iter().collect()), 0),
        ] {
            let fill = |store: &mut Store, place: &Rectangle, from: usize, to: usize| {
                for (y, x) in
                    (place.y[0]..place.y[1]).flat_map(|y| (place.x[0]..place.x[1]).map(move |x| (y, x)))
                {
                    for k in from..to + (x + y) % 3 {
                        let value = ((x * 7 + y * 13 + k * 5) % 11) as f32;
                        store.push(x - place.x[0], y - place.y[0], &vec![value; layout.len()]);
                    }
                }
            };
            let image = Rectangle::of_image(width, height);
            let mut whole = Store::new(width, height, layout.clone(), capacity, 9);
            fill(&mut whole, &image, 0, 4);
            let parts = [[0, 17, 0, 9], [17, 37, 0, 4], [17, 37, 4, 9]]
                .map(|[x0, x1, y0, y1]| Rectangle { x: [x0, x1], y: [y0, y1] });
            // One part starts empty as the whole did, the others are cut from it
            let mut stores = parts.map(|part| whole.crop(&part));
            stores[1] = Store::of_part(&parts[1], layout.clone(), capacity, 9);
            fill(&mut stores[1], &parts[1], 0, 4);
            fill(&mut whole, &image, 4, 9);
            let mut pasted = Store::new(width, height, layout.clone(), capacity, 9);
            for (part, store) in parts.iter().zip(&mut stores) {
                fill(store, part, 4, 9);
                pasted.paste(part, store);
            }
            assert!(pasted.rows() == whole.rows());
        }
    }
}
