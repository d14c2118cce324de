//! Fills pixels without samples with the mean of their nearest neighbours that have samples or were filled before.
//!
//! Takes the sample counts of an image; the order of filling then applies to any number of planes.

use std::ops::Range;

use rayon::prelude::*;

use crate::image::Planes;
use crate::stats::{Part, Store};

/// The pixels to fill, in order: a hole is filled from its rim inwards, ring by ring.
#[derive(Clone, Debug)]
pub struct HoleFilling(Vec<Hole>);

/// A pixel to fill.
#[derive(Clone, Copy, Debug)]
struct Hole {
    pixel: usize,
    /// Bits for the 3×3 pixels around it, row by row: those that have a value before it.
    sources: u16,
}

/// Ring of pixels that have not been reached.
const UNREACHED: u32 = u32::MAX;

/// Returns the means of all samples of a store; pixels without samples get those of their neighbours.
pub fn filled_means(store: &Store, dims: Range<usize>) -> Planes {
    let mut means = store.means(Part::Whole, dims);
    HoleFilling::new(store.width(), store.counts(Part::Whole).into_iter()).fill(&mut means);
    means
}

impl HoleFilling {
    /// Determines the order for an image of this width with these sample counts.
    pub fn new(width: usize, counts: impl Iterator<Item = u32>) -> Self {
        let mut rings: Vec<u32> = counts.map(|n| if n > 0 { 0 } else { UNREACHED }).collect();
        let size = (width, rings.len() / width.max(1));
        let sources = |rings: &[u32], pixel, ring| {
            neighbours(pixel, size).filter(|&(_, j)| rings[j] < ring).fold(0, |bits, (k, _)| bits | 1 << k)
        };

        // Find the pixels beside those with samples
        let mut holes = Vec::new();
        let mut reached: Vec<usize> = (0..rings.len())
            .filter(|&i| rings[i] == UNREACHED && neighbours(i, size).any(|(_, j)| rings[j] == 0))
            .collect();
        reached.iter().for_each(|&i| rings[i] = 1);

        // Advance ring by ring
        let mut ring = 1;
        while !reached.is_empty() {
            holes.extend(reached.iter().map(|&pixel| Hole { pixel, sources: sources(&rings, pixel, ring) }));
            let mut next = Vec::new();
            for (_, j) in reached.iter().flat_map(|&i| neighbours(i, size)) {
                if rings[j] == UNREACHED {
                    rings[j] = ring + 1;
                    next.push(j);
                }
            }
            (reached, ring) = (next, ring + 1);
        }
        Self(holes)
    }

    /// Fills the pixels in every plane. An image without any sample does not change.
    pub fn fill(&self, image: &mut Planes) {
        let size = (image.width(), image.height());
        let planes: Vec<&mut [f32]> = image.planes_mut().collect();
        planes.into_par_iter().for_each(|plane| {
            for hole in &self.0 {
                let sources = || neighbours(hole.pixel, size).filter(|(k, _)| hole.sources & 1 << k != 0);
                plane[hole.pixel] =
                    sources().map(|(_, j)| plane[j]).sum::<f32>() / hole.sources.count_ones() as f32;
            }
        });
    }
}

/// Returns the 3×3 pixels around one that lie in the image, each with its index among the 9.
fn neighbours(pixel: usize, (width, height): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    let (x, y) = (pixel % width, pixel / width);
    let all = (0..9).map(move |k| (k, x + k % 3, y + k / 3));
    let inside =
        move |&(_, x, y): &(usize, usize, usize)| (1..=width).contains(&x) && (1..=height).contains(&y);
    all.filter(inside).map(move |(k, x, y)| (k, (y - 1) * width + x - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pixel_fills_the_image_and_without_any_it_does_not_change() {
        let mut image = Planes::new(7, 5, 2);
        (image.plane_mut(0)[9], image.plane_mut(1)[9]) = (3.0, 4.0);
        let mut same = image.clone();
        HoleFilling::new(7, (0..35).map(|i| u32::from(i == 9))).fill(&mut image);
        assert!(image.plane(0).iter().all(|&v| v == 3.0) && image.plane(1).iter().all(|&v| v == 4.0));
        HoleFilling::new(7, [0; 35].into_iter()).fill(&mut same);
        assert_eq!(same.plane(0).iter().sum::<f32>(), 3.0);
        HoleFilling::new(0, std::iter::empty()).fill(&mut Planes::new(0, 3, 1));
    }

    #[test]
    fn a_pixel_becomes_the_mean_of_the_pixels_filled_before_it() {
        let mut row = Planes::new(5, 1, 1);
        row.data_mut().copy_from_slice(&[1.0, 9.0, 9.0, 9.0, 5.0]);
        HoleFilling::new(5, [1, 0, 0, 0, 2].into_iter()).fill(&mut row);
        assert_eq!(row.data(), [1.0, 1.0, 3.0, 5.0, 5.0]);
    }
}
