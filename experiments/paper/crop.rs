//! Computes the compared part of an image, and the larger part that is rendered so that the filters' windows are
//! complete at its borders.

/// Bounds in pixels: x0, x1, y0, y1, half open.
pub type Bounds = [usize; 4];

/// A crop of the film, with a margin around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    /// The pixels that are compared, on the film.
    pub inner: Bounds,
    /// The pixels that are rendered and filtered, on the film.
    pub outer: Bounds,
}

impl Crop {
    /// Adds `margin` pixels around the compared ones, as far as the film has them.
    pub fn new(inner: Bounds, margin: usize, film: (usize, usize)) -> Self {
        let [x0, x1, y0, y1] = inner;
        let outer = [
            x0.saturating_sub(margin),
            (x1 + margin).min(film.0),
            y0.saturating_sub(margin),
            (y1 + margin).min(film.1),
        ];
        Self { inner, outer }
    }

    /// The compared pixels, relative to the rendered ones.
    pub fn inner_in_outer(&self) -> Bounds {
        relative(self.inner, self.outer)
    }

    /// Number of pixels that are rendered and filtered.
    pub fn pixels(&self) -> usize {
        area(self.outer)
    }
}

/// Number of pixels within bounds.
pub fn area([x0, x1, y0, y1]: Bounds) -> usize {
    (x1 - x0) * (y1 - y0)
}

/// The middle of some bounds, of `size` pixels or as many as they have.
pub fn middle([x0, x1, y0, y1]: Bounds, size: (usize, usize)) -> Bounds {
    let part = |from: usize, to: usize, side: usize| {
        let side = side.clamp(1, to - from);
        let start = from + (to - from - side) / 2;
        [start, start + side]
    };
    let ([x0, x1], [y0, y1]) = (part(x0, x1, size.0), part(y0, y1, size.1));
    [x0, x1, y0, y1]
}

/// Bounds relative to the corner of others.
pub fn relative([x0, x1, y0, y1]: Bounds, [left, _, top, _]: Bounds) -> Bounds {
    [x0 - left, x1 - left, y0 - top, y1 - top]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_end_at_the_film() {
        let crop = Crop::new([10, 110, 50, 150], 27, (200, 160));
        assert_eq!(crop, Crop { inner: [10, 110, 50, 150], outer: [0, 137, 23, 160] });
        assert_eq!(crop.inner_in_outer(), [10, 110, 27, 127]);
        assert_eq!(crop.pixels(), 137 * 137);
    }

    #[test]
    fn the_middle_of_a_crop_is_inside_it() {
        assert_eq!(middle([10, 110, 50, 150], (50, 20)), [35, 85, 90, 110]);
        assert_eq!(middle([10, 110, 50, 150], (500, 0)), [10, 110, 99, 100]);
        assert_eq!(relative([35, 85, 90, 110], [10, 110, 50, 150]), [25, 75, 40, 60]);
    }
}
