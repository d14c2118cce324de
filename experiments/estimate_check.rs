//! Compares the program's error estimate with the true error, for an image and for its tiles.
//!
//! Takes an image with its estimate and the reference; gives values for the ledger.

use prpf::image::Planes;
use prpf::progressive::{ErrorEstimate, TILE};

use crate::ledger::{Values, values};
use crate::statistics::rank_correlation;
use crate::test_scene::TestScene;

/// An error estimate beside the true error of its image.
#[derive(Clone, Copy, Debug)]
pub struct EstimateCheck {
    pub spp: u32,
    /// Estimated relMSE, and its 95 % interval.
    pub estimate: f64,
    pub low: f64,
    pub high: f64,
    /// True relMSE.
    pub truth: f64,
    /// Spearman's rank correlation between estimated and true relMSE of the tiles.
    pub rank_correlation: f64,
}

impl EstimateCheck {
    /// Returns the values to record of an image's estimate.
    pub fn measure(estimate: &ErrorEstimate, image: &Planes, test_scene: &TestScene) -> Values {
        let (true_tiles, _) = relmse_of_tiles(image, &test_scene.reference.image);
        let tiles: Vec<f64> = estimate.tiles.plane(0).iter().map(|&v| f64::from(v)).collect();
        let [low, high] = estimate.interval();
        values([
            ("estimate", estimate.value),
            ("estimate low", low),
            ("estimate high", high),
            ("rank correlation", rank_correlation(&tiles, &true_tiles)),
        ])
    }

    /// Reads a check from recorded values; `None` if there was no estimate.
    pub fn from_values(spp: u32, values: &Values) -> Option<Self> {
        let value = |name: &str| values.get(name).copied();
        Some(Self {
            spp,
            estimate: value("estimate")?,
            low: value("estimate low")?,
            high: value("estimate high")?,
            truth: value("relmse")?.max(f64::MIN_POSITIVE),
            rank_correlation: value("rank correlation")?,
        })
    }
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
