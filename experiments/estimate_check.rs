//! Compares the loop's error estimates with the true error, for images and for their tiles.
//!
//! Takes the images that the estimates belong to and the reference; gives values for the ledger.

use prpf::image::Planes;
use prpf::progressive::TILE;

use crate::ledger::Values;
use crate::statistics::rank_correlation;
use crate::test_scene::TestScene;
use crate::trial::EstimatedImage;

/// An error estimate beside the true error of its image.
#[derive(Clone, Copy, Debug)]
pub struct EstimateCheck {
    /// Samples per pixel of the image.
    pub spp: f64,
    /// Estimated relMSE.
    pub estimate: f64,
    /// The estimate's own standard error.
    pub standard_error: f64,
    /// True relMSE.
    pub truth: f64,
    /// Spearman's rank correlation between estimated and true relMSE of the tiles.
    pub rank_correlation: f64,
}

impl EstimateCheck {
    /// Compares an estimate with the scene's reference.
    pub fn new(estimated: &EstimatedImage, test_scene: &TestScene) -> Self {
        let (true_tiles, mean) = relmse_of_tiles(&estimated.image, &test_scene.reference.image);
        let tiles: Vec<f64> = estimated.estimate.tiles.plane(0).iter().map(|&v| f64::from(v)).collect();
        Self {
            spp: estimated.spp,
            estimate: estimated.estimate.image,
            standard_error: estimated.estimate.standard_error,
            truth: (mean - test_scene.reference.relmse).max(f64::MIN_POSITIVE),
            rank_correlation: rank_correlation(&tiles, &true_tiles),
        }
    }

    /// The values to record for the check with this index.
    pub fn to_values(self, index: usize) -> Values {
        let values = [
            ("spp", self.spp),
            ("estimate", self.estimate),
            ("standard error", self.standard_error),
            ("truth", self.truth),
            ("rank correlation", self.rank_correlation),
        ];
        values.map(|(name, value)| (quantity(index, name), value)).into()
    }

    /// Reads all checks from recorded values, in the order of their indices.
    pub fn from_values(values: &Values) -> Vec<Self> {
        let value = |i: usize, name: &str| values.get(&quantity(i, name)).copied();
        let check = |i: usize| {
            Some(Self {
                spp: value(i, "spp")?,
                estimate: value(i, "estimate")?,
                standard_error: value(i, "standard error")?,
                truth: value(i, "truth")?,
                rank_correlation: value(i, "rank correlation")?,
            })
        };
        (0..).map_while(check).collect()
    }
}

fn quantity(index: usize, name: &str) -> String {
    format!("check {index}: {name}")
}

/// relMSE of each tile, and of the image. Tiles are those of the loop's estimate.
fn relmse_of_tiles(image: &Planes, reference: &Planes) -> (Vec<f64>, f64) {
    let (width, columns) = (image.width(), image.width().div_ceil(TILE));
    let tiles = columns * image.height().div_ceil(TILE);
    let (mut sums, mut counts) = (vec![0.0; tiles], vec![0.0; tiles]);
    for (i, error) in pixel_relmse(image, reference).into_iter().enumerate() {
        let tile = i / width / TILE * columns + i % width / TILE;
        sums[tile] += error;
        counts[tile] += 1.0;
    }
    let mean = sums.iter().sum::<f64>() / counts.iter().sum::<f64>();
    (sums.iter().zip(counts).map(|(sum, count)| sum / count).collect(), mean)
}

/// relMSE of each pixel: the mean over its channels.
pub fn pixel_relmse(image: &Planes, reference: &Planes) -> Vec<f64> {
    /// As in the library's relMSE.
    const FLOOR: f64 = 0.01;
    let channel_relmse = |i: usize, c: usize| {
        let (x, r) = (f64::from(image.plane(c)[i]), f64::from(reference.plane(c)[i]));
        (x - r).powi(2) / (r * r + FLOOR)
    };
    (0..image.pixels()).map(|i| (0..3).map(|c| channel_relmse(i, c)).sum::<f64>() / 3.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prpf::image::metrics::Pair;

    fn planes(value: impl Fn(usize) -> f32) -> Planes {
        let mut planes = Planes::new(20, 18, 3);
        planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = value(i));
        planes
    }

    #[test]
    fn tiles_add_up_to_the_library_s_relmse() {
        let (image, reference) = (planes(|i| (i % 7) as f32), planes(|i| (i % 5) as f32));
        let (tiles, mean) = relmse_of_tiles(&image, &reference);
        assert_eq!(tiles.len(), 4);
        assert!((mean - Pair::new(&image, &reference).unwrap().relmse()).abs() < 1e-9 * mean);
    }
}
