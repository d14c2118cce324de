//! The part of a scene that is compared, and what is rendered around it so that the filters' windows are
//! full at its borders.

/// Half-open bounds in pixels of the film: x0, x1, y0, y1.
pub type Bounds = [usize; 4];

/// A part and its margins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// What is compared, on the film.
    pub inner: Bounds,
    /// What is rendered and filtered, on the film.
    pub outer: Bounds,
}

impl Part {
    /// The middle `share` of a crop, with so many pixels around it as the film has.
    pub fn new([x0, x1, y0, y1]: Bounds, share: f64, margin: usize, film: (usize, usize)) -> Self {
        let middle = |from: usize, to: usize| {
            let side = (((to - from) as f64 * share).round() as usize).clamp(1, to - from);
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

    /// What is compared, in pixels of what is rendered.
    pub fn within(&self) -> Bounds {
        let ([x0, x1, y0, y1], [left, _, top, _]) = (self.inner, self.outer);
        [x0 - left, x1 - left, y0 - top, y1 - top]
    }

    /// Pixels that are rendered and filtered.
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
        let part = Part::new([10, 110, 50, 150], 1.0, 27, (200, 160));
        assert_eq!(part, Part { inner: [10, 110, 50, 150], outer: [0, 137, 23, 160] });
        assert_eq!(part.within(), [10, 110, 27, 127]);
        assert_eq!(part.pixels(), 137 * 137);
    }

    #[test]
    fn a_share_is_the_middle_of_a_crop() {
        assert_eq!(Part::new([10, 110, 50, 150], 0.5, 0, (200, 200)).inner, [35, 85, 75, 125]);
    }
}
