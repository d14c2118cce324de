//! A rectangle of pixels of an image.

/// Columns and rows of an image, half open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Rectangle {
    pub x: [usize; 2],
    pub y: [usize; 2],
}

impl Rectangle {
    /// All pixels of an image.
    pub fn whole(width: usize, height: usize) -> Self {
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
