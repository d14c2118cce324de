//! What choosing neighbours by pixels lets in that choosing them by samples would not (paper, section
//! 4.1): samples of pixels whose means are within the tolerance, and which are not so themselves.

use rayon::prelude::*;

use super::colours::Colours;
use super::neighbourhood::Guide;
use super::prpf::PrpfSettings;
use crate::stats::Store;

/// Share of the samples in the clusters of pixels that are outside the tolerance of the cluster's centre in
/// some feature: of the samples that the store keeps, at every `grid_spacing`-th pixel along both axes.
/// 0 where no samples are kept.
pub fn samples_outside(store: &Store, settings: &PrpfSettings, window: usize) -> f64 {
    let colours = Colours::new(store, &settings.outliers);
    let guide = Guide::new(store, colours.guide(), settings);
    let spacing = settings.grid_spacing.max(1);
    let dims = store.layout().len();
    let of_row = |y: usize| {
        let mut cluster = Vec::new();
        let (mut outside, mut all) = (0_u64, 0_u64);
        for x in (spacing / 2..store.width()).step_by(spacing) {
            guide.cluster(x, y, window, &mut cluster);
            for &(xj, yj) in &cluster {
                for sample in store.rows()[yj as usize].reservoir(xj as usize).chunks_exact(dims) {
                    let differs = |(k, &dim): (usize, &usize)| {
                        let d = sample[dim] - guide.means.at(k, x, y);
                        d * d > guide.thresholds.at(k, x, y)
                    };
                    outside += u64::from(guide.feature_dims().iter().enumerate().any(differs));
                    all += 1;
                }
            }
        }
        (outside, all)
    };
    let rows: Vec<usize> = (spacing / 2..store.height()).step_by(spacing).collect();
    let (outside, all) = rows.into_par_iter().map(of_row).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    outside as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{store, wall};
    use super::*;
    use crate::stats::{Block, Layout};

    #[test]
    fn samples_far_from_their_own_pixels_mean_are_counted() {
        // Of every 16 samples one has an albedo of 1, the others 0: the deviation is 0.25, so that it lies
        // 3.75 deviations from the mean, and the others a quarter of one.
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
        let share = samples_outside(&store, &settings, 7);
        assert!((0.03..0.1).contains(&share), "a sixteenth: {share}");
        assert_eq!(samples_outside(&store, &PrpfSettings { z: 5.0, ..settings }, 7), 0.0);
    }
}
