//! A batch for the region of the image that is rendered first.

use super::settings::Settings;
use crate::stats::Rectangle;

/// A batch within a region.
pub struct RegionBatch {
    pixels: Vec<usize>,
    width: usize,
    samples: u64,
}

impl RegionBatch {
    /// Plans the batch of at most `total` samples that the region gets; `None` if it is outside the image or has its budget.
    pub fn new(
        region: &Rectangle,
        counts: &[u32],
        width: usize,
        total: u64,
        settings: &Settings,
    ) -> Option<Self> {
        let image = Rectangle::whole(width, counts.len() / width.max(1));
        let Rectangle { x: [x0, x1], y: [y0, y1] } = region.intersection(&image)?;
        let pixels: Vec<usize> = (y0..y1).flat_map(|y| (x0..x1).map(move |x| y * width + x)).collect();
        let have: u64 = pixels.iter().map(|&i| u64::from(counts[i])).sum();
        let all = |spp: u32| u64::from(spp) * pixels.len() as u64;
        let most = settings.budget.spp.map_or(settings.max_spp, |spp| spp.min(settings.max_spp));
        // As with batches of the whole image: the total doubles.
        let samples = have.max(all(settings.min_spp.max(1))).min(total).min(all(most).saturating_sub(have));
        (samples > 0).then_some(Self { pixels, width: x1 - x0, samples })
    }

    /// Returns the samples of the batch.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Returns the samples of each pixel of the whole image, of which only the region gets some, as `spread` spreads them
    /// over (priorities, counts, width, total).
    pub fn allocate(
        &self,
        counts: &[u32],
        priority: Option<&[f32]>,
        spread: impl Fn(Option<&[f32]>, &[u32], usize, u64) -> Vec<u32>,
    ) -> Vec<u32> {
        let have: Vec<u32> = self.pixels.iter().map(|&i| counts[i]).collect();
        let inside: Option<Vec<f32>> =
            priority.map(|priority| self.pixels.iter().map(|&i| priority[i]).collect());
        let inside = spread(inside.as_deref(), &have, self.width, self.samples);
        let mut whole = vec![0; counts.len()];
        self.pixels.iter().zip(inside).for_each(|(&i, n)| whole[i] = n);
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adaptive::{self, Sampling};
    use crate::progressive::budget::Budget;

    fn settings(spp: u32) -> Settings {
        Settings {
            budget: Budget { spp: Some(spp), ..Budget::default() },
            sampling: Sampling::Uniform,
            max_spp: 1000,
            ..Settings::default()
        }
    }

    #[test]
    fn a_region_gets_samples_until_it_has_the_budget() {
        let region = Rectangle { x: [2, 4], y: [1, 3] };
        let mut counts = vec![2; 6 * 5];
        let mut sizes = Vec::new();
        while let Some(batch) = RegionBatch::new(&region, &counts, 6, 10_000, &settings(20)) {
            let uniform = |_: Option<&[f32]>, have: &[u32], _, total| adaptive::uniform(total, have, 1000, 0);
            let added = batch.allocate(&counts, None, uniform);
            sizes.push(added.iter().sum::<u32>());
            counts.iter_mut().zip(&added).for_each(|(n, new)| *n += new);
        }
        assert_eq!(sizes, [16, 24, 32]);
        let inside = |i: usize| (2..4).contains(&(i % 6)) && (1..3).contains(&(i / 6));
        assert!((0..30).all(|i| counts[i] == if inside(i) { 20 } else { 2 }));
    }

    #[test]
    fn a_region_outside_the_image_is_none() {
        let region = Rectangle { x: [7, 9], y: [0, 5] };
        assert!(RegionBatch::new(&region, &[2; 30], 6, 100, &settings(20)).is_none());
    }
}
