//! Planes with a margin on all sides, so that windows and patches need no test at the image's border. The
//! windows of `padded` know only margins to the left and right.

use rayon::prelude::*;

/// Values behind the last row, so that rows can be read in whole vectors.
pub(super) const SLACK: usize = 32;

/// Planes of one size with `margin` extra pixels on every side.
#[derive(Clone, Debug)]
pub(super) struct Bordered {
    width: usize,
    margin: usize,
    planes: Vec<Vec<f32>>,
}

/// What stands in the margin.
#[derive(Clone, Copy, Debug)]
pub(super) enum Margin {
    /// The nearest pixel of the image.
    Nearest,
    /// One value.
    Value(f32),
}

impl Bordered {
    /// Copies planes of `width`×`height` values.
    pub fn new(width: usize, height: usize, planes: &[&[f32]], margin: usize, fill: Margin) -> Self {
        let planes = planes.par_iter().map(|plane| pad(width, height, plane, margin, fill)).collect();
        Self { width, margin, planes }
    }

    pub fn count(&self) -> usize {
        self.planes.len()
    }

    /// `length` values of a row from column `x` on; both may reach into the margin, and the length
    /// beyond it by up to [`SLACK`] values that mean nothing.
    #[inline]
    pub fn span(&self, plane: usize, x: isize, y: isize, length: usize) -> &[f32] {
        let margin = self.margin as isize;
        let start = (y + margin) as usize * (self.width + 2 * self.margin) + (x + margin) as usize;
        &self.planes[plane][start..][..length]
    }
}

fn pad(width: usize, height: usize, plane: &[f32], margin: usize, fill: Margin) -> Vec<f32> {
    let stride = width + 2 * margin;
    let rows = height + 2 * margin;
    let mut padded = vec![0.0; stride * rows + SLACK];
    for (y, row) in padded.chunks_exact_mut(stride).take(rows).enumerate() {
        let inside = (margin..margin + height).contains(&y);
        if let (Margin::Value(value), false) = (fill, inside) {
            row.fill(value);
            continue;
        }
        let source = &plane[(y.max(margin) - margin).min(height - 1) * width..][..width];
        row[margin..margin + width].copy_from_slice(source);
        let (left, right) = match fill {
            Margin::Nearest => (source[0], source[width - 1]),
            Margin::Value(value) => (value, value),
        };
        row[..margin].fill(left);
        row[margin + width..].fill(right);
    }
    padded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_reach_into_margins_of_either_kind_from_any_pixel() {
        let (width, height, margin) = (5_isize, 3_isize, 4_isize);
        let plane: Vec<f32> = (0..15).map(|i| i as f32).collect();
        let other: Vec<f32> = plane.iter().map(|v| 100.0 + v).collect();
        for fill in [Margin::Nearest, Margin::Value(-1.0)] {
            let planes = [plane.as_slice(), other.as_slice()];
            let bordered = Bordered::new(width as usize, height as usize, &planes, margin as usize, fill);
            assert_eq!(bordered.count(), 2);
            for (x, y) in
                (-margin..height + margin).flat_map(|y| (-margin..width + margin).map(move |x| (x, y)))
            {
                let inside = (0..width).contains(&x) && (0..height).contains(&y);
                let nearest = (y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as f32;
                for (p, base) in [0.0, 100.0].into_iter().enumerate() {
                    let expected = match fill {
                        Margin::Value(value) if !inside => value,
                        _ => base + nearest,
                    };
                    assert_eq!(bordered.span(p, x, y, 1), [expected], "{p} {x} {y} {fill:?}");
                    let to_end = (width + margin - x) as usize;
                    assert_eq!(bordered.span(p, x, y, to_end)[0], expected);
                }
            }
            // Behind the last row there is what vectors may read.
            assert_eq!(bordered.span(1, width + margin, height + margin - 1, SLACK).len(), SLACK);
        }
    }
}
