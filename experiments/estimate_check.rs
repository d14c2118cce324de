//! Compares the program's error estimate with the true error, for an image and for its tiles.
//!
//! Takes an image with its estimate and the reference; gives values for the ledger.

use prpf::image::Planes;
use prpf::progressive::{ErrorEstimate, TILE};

use crate::ledger::{Values, values};
use crate::statistics::rank_correlation;
use crate::test_scene::TestScene;

/// An error estimate beside the true error of its image.
#[derive(Clone, Copy, Debug, PartialEq)]
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
        let errors = test_scene.reference.pixel_relmse(image);
        let true_tiles = means_of_tiles(&errors, image.width(), image.height());
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

/// Mean of a value of each pixel over tiles, which are those of the loop's estimate.
fn means_of_tiles(values: &[f64], width: usize, height: usize) -> Vec<f64> {
    let columns = width.div_ceil(TILE);
    let tiles = columns * height.div_ceil(TILE);
    let (mut sums, mut counts) = (vec![0.0; tiles], vec![0.0; tiles]);
    for (i, value) in values.iter().enumerate() {
        let tile = i / width / TILE * columns + i % width / TILE;
        sums[tile] += value;
        counts[tile] += 1.0;
    }
    sums.iter().zip(counts).map(|(sum, count)| sum / count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_at_the_border_have_fewer_pixels() {
        let values: Vec<f64> = (0..20 * 18).map(|i| if i % 20 < 16 { 1.0 } else { 3.0 }).collect();
        assert_eq!(means_of_tiles(&values, 20, 18), [1.0, 3.0, 1.0, 3.0]);
    }
}
