//! Pixels without samples, and what stands in for them: the mean of the nearest ones around that have some.

use rayon::prelude::*;

use crate::image::Planes;

/// In the order in which they are filled: ring by ring inwards, so that a hole of any size fills from its rim.
#[derive(Clone, Debug)]
pub(super) struct Gaps(Vec<Gap>);

#[derive(Clone, Copy, Debug)]
struct Gap {
    pixel: usize,
    /// Bits for the 3×3 pixels around it, row by row: those that have a value before.
    from: u16,
}

/// Not yet reached from a pixel with samples.
const FAR: u32 = u32::MAX;

impl Gaps {
    /// Of an image of this width, by number of samples.
    pub fn of(width: usize, counts: impl Iterator<Item = u32>) -> Self {
        let mut rings: Vec<u32> = counts.map(|n| if n > 0 { 0 } else { FAR }).collect();
        let size = (width, rings.len() / width.max(1));
        let known = |rings: &[u32], pixel, ring| {
            around(pixel, size).filter(|&(_, j)| rings[j] < ring).fold(0, |bits, (k, _)| bits | 1 << k)
        };
        let mut gaps = Vec::new();
        let mut reached: Vec<usize> = (0..rings.len())
            .filter(|&i| rings[i] == FAR && around(i, size).any(|(_, j)| rings[j] == 0))
            .collect();
        reached.iter().for_each(|&i| rings[i] = 1);
        let mut ring = 1;
        while !reached.is_empty() {
            gaps.extend(reached.iter().map(|&pixel| Gap { pixel, from: known(&rings, pixel, ring) }));
            let mut next = Vec::new();
            for (_, j) in reached.iter().flat_map(|&i| around(i, size)) {
                if rings[j] == FAR {
                    rings[j] = ring + 1;
                    next.push(j);
                }
            }
            (reached, ring) = (next, ring + 1);
        }
        Self(gaps)
    }

    /// Fills the same pixels of every plane. An image without any sample stays as it is.
    pub fn fill(&self, image: &mut Planes) {
        let size = (image.width(), image.height());
        let planes: Vec<&mut [f32]> = image.planes_mut().collect();
        planes.into_par_iter().for_each(|plane| {
            for gap in &self.0 {
                let from = || around(gap.pixel, size).filter(|(k, _)| gap.from & 1 << k != 0);
                plane[gap.pixel] = from().map(|(_, j)| plane[j]).sum::<f32>() / gap.from.count_ones() as f32;
            }
        });
    }
}

/// The pixels of the 3×3 around one that are in the image, and their places in it.
fn around(pixel: usize, (width, height): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    let (x, y) = (pixel % width, pixel / width);
    let places = (0..9).map(move |k| (k, x + k % 3, y + k / 3));
    let inside =
        move |&(_, x, y): &(usize, usize, usize)| (1..=width).contains(&x) && (1..=height).contains(&y);
    places.filter(inside).map(move |(k, x, y)| (k, (y - 1) * width + x - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pixel_fills_the_image_and_none_leaves_it() {
        let mut image = Planes::new(7, 5, 2);
        (image.plane_mut(0)[9], image.plane_mut(1)[9]) = (3.0, 4.0);
        let mut same = image.clone();
        Gaps::of(7, (0..35).map(|i| u32::from(i == 9))).fill(&mut image);
        assert!(image.plane(0).iter().all(|&v| v == 3.0) && image.plane(1).iter().all(|&v| v == 4.0));
        Gaps::of(7, [0; 35].into_iter()).fill(&mut same);
        assert_eq!(same.plane(0).iter().sum::<f32>(), 3.0);
        Gaps::of(0, std::iter::empty()).fill(&mut Planes::new(0, 3, 1));
    }

    #[test]
    fn a_pixel_takes_the_mean_of_those_that_were_there_before_it() {
        let mut row = Planes::new(5, 1, 1);
        row.data_mut().copy_from_slice(&[1.0, 9.0, 9.0, 9.0, 5.0]);
        Gaps::of(5, [1, 0, 0, 0, 2].into_iter()).fill(&mut row);
        assert_eq!(row.data(), [1.0, 1.0, 3.0, 5.0, 5.0]);
    }
}
