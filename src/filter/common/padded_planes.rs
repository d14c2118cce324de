//! Planes with a margin on all four sides, so that windows and patches need no bounds test at the
//! border of the image.
//!
//! Planes are stored one after the other. [`InterleavedPlanes`](super::interleaved_planes) have
//! margins on the left and right only and store row after row.

use rayon::prelude::*;

/// Values after the last row, so that a row can be read in whole vectors.
const SLACK: usize = 32;

/// Planes of one size with `margin` additional pixels on every side.
#[derive(Clone, Debug)]
pub struct PaddedPlanes {
    width: usize,
    margin: usize,
    planes: Vec<Vec<f32>>,
}

/// Content of the margin.
#[derive(Clone, Copy, Debug)]
pub enum Margin {
    /// The value of the nearest pixel of the image.
    Nearest,
    /// A constant.
    Value(f32),
}

impl PaddedPlanes {
    /// Copies planes of `width`×`height` values.
    pub fn new(width: usize, height: usize, planes: &[&[f32]], margin: usize, fill: Margin) -> Self {
        let planes = planes.par_iter().map(|plane| pad(width, height, plane, margin, fill)).collect();
        Self { width, margin, planes }
    }

    pub fn count(&self) -> usize {
        self.planes.len()
    }

    /// Returns `length` values of row `y` from column `x` on. Both coordinates may lie in the margin.
    /// The span may extend past the right margin by up to `SLACK` values, which are unspecified.
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
    fn spans_read_image_and_margin_for_both_kinds_of_margin() {
        let (width, height, margin) = (5_isize, 3_isize, 4_isize);
        let plane: Vec<f32> = (0..15).map(|i| i as f32).collect();
        let other: Vec<f32> = plane.iter().map(|v| 100.0 + v).collect();
        for fill in [Margin::Nearest, Margin::Value(-1.0)] {
            let planes = [plane.as_slice(), other.as_slice()];
            let padded = PaddedPlanes::new(width as usize, height as usize, &planes, margin as usize, fill);
            assert_eq!(padded.count(), 2);
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
                    assert_eq!(padded.span(p, x, y, 1), [expected], "{p} {x} {y} {fill:?}");
                    let to_end = (width + margin - x) as usize;
                    assert_eq!(padded.span(p, x, y, to_end)[0], expected);
                }
            }
            // Vectors may read past the last row.
            assert_eq!(padded.span(1, width + margin, height + margin - 1, SLACK).len(), SLACK);
        }
    }
}
