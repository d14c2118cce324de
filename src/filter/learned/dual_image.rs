//! An image with its noise: what filters one filters the other.

use rayon::prelude::*;

use crate::filter::common::TASK_PIXELS;
use crate::filter::common::half_counts::HalfCounts;
use crate::filter::whole_image::WholeImage;
use crate::image::Planes;

/// An image, and the difference of its halves scaled so that its variance is the image's: with the fractions p of the
/// samples √(p_A p_B) (A − B). What filters the image filters it too, and so gives the filtered image's halves.
#[derive(Clone)]
pub struct DualImage {
    pub mean: Planes,
    pub noise: Planes,
}

impl DualImage {
    /// `mean` and `halves` have the same number of planes. Pixels of a half without samples are filled
    /// ([`HalfCounts::fill_missing`]).
    pub fn new(mean: Planes, mut halves: [Planes; 2], counts: &HalfCounts) -> Self {
        counts.fill_missing(&mut halves);
        let [mut noise, b] = halves;
        for (noise, b) in noise.planes_mut().zip(b.data().chunks(b.pixels().max(1))) {
            let values = noise.par_iter_mut().with_min_len(TASK_PIXELS).zip(b).zip(counts.fractions());
            values.for_each(|((noise, b), [p_a, p_b])| *noise = (p_a * p_b).sqrt() * (*noise - b));
        }
        Self { mean, noise }
    }

    /// An image without noise.
    pub fn exact(mean: Planes) -> Self {
        Self { noise: Planes::new(mean.width(), mean.height(), mean.count()), mean }
    }

    /// Multiplies each pixel by its factor.
    pub fn scale(&mut self, factors: &[f32]) {
        for planes in [&mut self.mean, &mut self.noise] {
            for plane in planes.planes_mut() {
                let values = plane.par_iter_mut().with_min_len(TASK_PIXELS).zip(factors);
                values.for_each(|(v, factor)| *v *= factor);
            }
        }
    }

    /// Returns the images of the halves.
    pub fn halves(&self, counts: &HalfCounts) -> [Planes; 2] {
        [(0, 1.0), (1, -1.0)].map(|(half, sign)| {
            let mut image = self.mean.clone();
            for (image, noise) in image.planes_mut().zip(self.noise.data().chunks(self.noise.pixels().max(1)))
            {
                let values =
                    image.par_iter_mut().with_min_len(TASK_PIXELS).zip(noise).zip(counts.fractions());
                values.for_each(|((value, noise), p)| {
                    // Without samples of both halves the noise is not known.
                    let factor = if p[half] > 0.0 { (p[1 - half] / p[half]).sqrt() } else { 0.0 };
                    *value += sign * factor * noise;
                });
            }
            image
        })
    }

    /// Takes the values of the margin from the parts there.
    pub fn complete_margin(&mut self, whole: &dyn WholeImage) {
        whole.complete_margin(&mut self.mean, 1);
        whole.complete_margin(&mut self.noise, 1);
    }

    /// Adds another image, multiplied by a factor.
    pub fn add_scaled(&mut self, factor: f32, other: &Self) {
        for (sum, term) in [(&mut self.mean, &other.mean), (&mut self.noise, &other.noise)] {
            let values = sum.data_mut().par_iter_mut().with_min_len(TASK_PIXELS).zip(term.data());
            values.for_each(|(sum, &term)| *sum += factor * term);
        }
    }

    /// Returns the mean and the noise.
    pub fn parts(&self) -> [&Planes; 2] {
        [&self.mean, &self.noise]
    }
}
