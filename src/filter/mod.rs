//! From a pixel-statistics store to an image and maps: P-RPF, a file for each step of the paper,
//! the patch-distance filter of `standard` and `draft`, and random parameter filtering for comparison.
//!
//! Knows nothing of where samples come from.

mod assessment;
mod bilateral;
pub mod blur;
mod bordered;
mod colours;
mod distance;
mod fast_exp;
mod gaps;
mod halves;
mod mutual_information;
mod neighbourhood;
mod outliers;
mod padded;
mod patch;
pub mod prpf;
mod regression;
pub mod rpf;
mod stack;
pub mod stages;
pub mod standard;
#[cfg(test)]
mod synthetic;
pub mod tolerance;
mod upsampling;
mod weights;

pub use mutual_information::mutual_information;
pub use outliers::OutlierSettings;
pub use prpf::{Gain, PrpfSettings};
pub use rpf::RpfSettings;
pub use standard::StandardSettings;

use crate::image::Planes;
use crate::stats::{Part, Store};
use gaps::Gaps;

/// Residuals end here: where hardly any noise is expected, any difference is that many times too large.
const LARGEST_RESIDUAL: f32 = 1e6;

/// What a filter makes of a store.
#[derive(Clone, Debug)]
pub struct Filtered {
    /// The image: 3 planes, linear RGB, directly visible emission included.
    pub image: Planes,
    /// The image as each half of the samples alone gives it (with weights that may come from
    /// elsewhere); `image` is their mean, weighted by sample counts.
    pub halves: [Planes; 2],
    /// Where interpolation of feature weights failed: 1 at pixels computed directly, 0 at
    /// interpolated and grid pixels (averaged over passes). 1 plane; `None` where the filter ran
    /// without its grid stage.
    pub interpolation_failure: Option<Planes>,
    /// Share of non-grid pixels whose weights were interpolated.
    pub interpolation_success: Option<f32>,
    /// Squared difference of the filtered from the unfiltered image over its expected value; about
    /// 1 where the filter is right, above where it is biased. 1 plane.
    pub residual: Planes,
    /// Estimated variance of the pixel: of a filtered image ¼(F_A − F_B)² from its halves, of an
    /// unfiltered one s²/n. 3 planes.
    pub variance: Planes,
    /// Estimated squared error of the filtered pixel, mean of channels. 1 plane.
    pub error: Planes,
}

/// How much effort the reconstruction makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "app", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// As standard, with smaller discs and without its linear fit: for reruns between batches.
    Draft,
    /// The patch-distance filter: what measures best.
    Standard,
    /// P-RPF as published; two of its statistics are sampled.
    Paper,
}

impl Quality {
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Standard => "standard",
            Self::Paper => "paper",
        }
    }
}

/// Makes an image of a store. `seed` decides which samples mutual information is estimated from.
pub fn filter(store: &Store, quality: Quality, seed: u64) -> Filtered {
    match quality {
        Quality::Draft => standard::filter(store, &StandardSettings::draft()),
        Quality::Standard => standard::filter(store, &StandardSettings::standard()),
        Quality::Paper => prpf::filter(store, &PrpfSettings::paper(), seed),
    }
}

/// The means of the samples, in the shape of a filtered image. A pixel without samples looks like the nearest ones
/// that have some.
pub fn unfiltered(store: &Store) -> Filtered {
    let radiance = store.layout().radiance();
    let variance = variance_of_mean(store);
    let mut error = Planes::new(store.width(), store.height(), 1);
    let mut residual = error.clone();
    residual.data_mut().fill(1.0);
    for (i, error) in error.data_mut().iter_mut().enumerate() {
        *error = (0..3).map(|c| variance.plane(c)[i]).sum::<f32>() / 3.0;
    }
    let mut image = store.means(Part::Whole, radiance.clone());
    Gaps::of(store.width(), store.counts(Part::Whole).into_iter()).fill(&mut image);
    Filtered {
        image,
        halves: [0, 1].map(|h| store.means(Part::Half(h), radiance.clone())),
        interpolation_failure: None,
        interpolation_success: None,
        residual,
        variance,
        error,
    }
}

/// Variance of the mean of the unfiltered radiance, emission included: 3 planes; 0 where fewer than
/// two samples are.
pub fn variance_of_mean(store: &Store) -> Planes {
    let mut variance = store.variances(Part::Whole, store.layout().radiance());
    let counts = store.counts(Part::Whole);
    for plane in variance.planes_mut() {
        plane.iter_mut().zip(&counts).for_each(|(v, &n)| *v /= n.max(1) as f32);
    }
    variance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Block, Layout};

    #[test]
    fn the_variance_of_a_mean_is_that_of_its_samples_over_their_number() {
        let layout = Layout::with_blocks(|_| false);
        let mut store = Store::new(3, 1, layout.clone(), 0, 0);
        // Of variance 20/3, by number of samples; pixels with one sample and without any.
        for (pixel, values) in [(0, [3.0, 5.0, 7.0, 9.0].as_slice()), (1, &[4.0_f32])] {
            for &value in values {
                let mut sample = vec![0.0; layout.len()];
                layout.write(&mut sample, Block::Colour, &[value, 2.0 * value, 0.5]);
                layout.write(&mut sample, Block::Radiance, &[value, 2.0 * value, 0.5]);
                store.push(pixel, 0, &sample);
            }
        }
        let variance = variance_of_mean(&store);
        for (plane, expected) in [20.0 / 12.0, 4.0 * 20.0 / 12.0, 0.0].into_iter().enumerate() {
            let found = variance.plane(plane);
            assert!((found[0] - expected).abs() < 1e-5, "{plane}: {found:?}");
            assert_eq!(found[1..], [0.0; 2]);
        }
    }
}
