//! Fraction of a cluster's samples that selecting samples instead of pixels would exclude (paper, section
//! 4.1): the means of their pixels are similar, but they themselves are not.

use rayon::prelude::*;

use super::feature_guide::FeatureGuide;
use super::settings::PrpfSettings;
use crate::filter::common::colours::Colours;
use crate::stats::Store;

/// Returns the fraction of samples in the clusters of pixels that differ from the centre's mean by more than the
/// similarity threshold in some feature. It is measured on the samples in the reservoirs, for clusters of every
/// `grid_spacing`-th pixel along both axes; 0 if the reservoirs are empty.
pub fn dissimilar_fraction(store: &Store, settings: &PrpfSettings, window: usize) -> f64 {
    let colours = Colours::new(store, &settings.fireflies);
    let guide = FeatureGuide::new(store, colours.guide(), settings);
    let spacing = settings.grid_spacing.max(1);
    let dims = store.layout().len();
    let count_row = |y: usize| {
        let mut cluster = Vec::new();
        let (mut dissimilar, mut all) = (0_u64, 0_u64);
        for x in (spacing / 2..store.width()).step_by(spacing) {
            guide.cluster(x, y, window, &mut cluster);
            for &(xj, yj) in &cluster {
                for sample in store.rows()[yj as usize].reservoir(xj as usize).chunks_exact(dims) {
                    let differs = |(k, &dim): (usize, &usize)| {
                        let d = sample[dim] - guide.means.at(k, x, y);
                        d * d > guide.thresholds.at(k, x, y)
                    };
                    dissimilar += u64::from(guide.feature_dims().iter().enumerate().any(differs));
                    all += 1;
                }
            }
        }
        (dissimilar, all)
    };
    let rows: Vec<usize> = (spacing / 2..store.height()).step_by(spacing).collect();
    let (dissimilar, all) =
        rows.into_par_iter().map(count_row).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    dissimilar as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::{Block, Layout};

    #[test]
    fn samples_far_from_the_mean_of_their_own_pixel_are_counted() {
        // One of 16 samples has albedo 1, the others 0: the standard deviation is 0.25, so that it lies 3.75
        // standard deviations from the mean and the others a quarter of one.
        let layout = Layout::with_blocks(|block| block == Block::Albedo);
        let store = store(
            20,
            20,
            layout.clone(),
            |_, _| 16,
            |x, y, index, rng| {
                let albedo = if index % 16 == 5 { 1.0 } else { 0.0 };
                let mut sample = wall(&layout, x, y, [0.5; 3], rng);
                layout.write(&mut sample, Block::Albedo, &[albedo; 3]);
                sample
            },
        );
        let settings = PrpfSettings::paper();
        let fraction = dissimilar_fraction(&store, &settings, 7);
        assert!((0.03..0.1).contains(&fraction), "{fraction} for a sixteenth");
        assert_eq!(dissimilar_fraction(&store, &PrpfSettings { z: 5.0, ..settings }, 7), 0.0);
    }
}
