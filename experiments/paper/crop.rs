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
    /// Takes the middle `fraction` of a crop's width and height, and `margin` pixels around it, as far as the film
    /// has them.
    pub fn new([x0, x1, y0, y1]: Bounds, fraction: f64, margin: usize, film: (usize, usize)) -> Self {
        let middle = |from: usize, to: usize| {
            let side = (((to - from) as f64 * fraction).round() as usize).clamp(1, to - from);
            let start = from + (to - from - side) / 2;
            [start, start + side]
        };
        let ([x0, x1], [y0, y1]) = (middle(x0, x1), middle(y0, y1));
        let outer = [
            x0.saturating_sub(margin),
            (x1 + margin).min(film.0),
            y0.saturating_sub(margin),
            (y1 + margin).min(film.1),
        ];
        Self { inner: [x0, x1, y0, y1], outer }
    }

    /// The compared pixels, relative to the rendered ones.
    pub fn inner_in_outer(&self) -> Bounds {
        let ([x0, x1, y0, y1], [left, _, top, _]) = (self.inner, self.outer);
        [x0 - left, x1 - left, y0 - top, y1 - top]
    }

    /// Number of pixels that are rendered and filtered.
    pub fn pixels(&self) -> usize {
        let [x0, x1, y0, y1] = self.outer;
        (x1 - x0) * (y1 - y0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_end_at_the_film() {
        let crop = Crop::new([10, 110, 50, 150], 1.0, 27, (200, 160));
        assert_eq!(crop, Crop { inner: [10, 110, 50, 150], outer: [0, 137, 23, 160] });
        assert_eq!(crop.inner_in_outer(), [10, 110, 27, 127]);
        assert_eq!(crop.pixels(), 137 * 137);
    }

    #[test]
    fn a_fraction_is_the_middle_of_a_crop() {
        assert_eq!(Crop::new([10, 110, 50, 150], 0.5, 0, (200, 200)).inner, [35, 85, 75, 125]);
    }
}
