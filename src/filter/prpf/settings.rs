//! Constants of P-RPF.

use crate::filter::common::fireflies::FireflySettings;
use crate::simd::LANES;

/// Reading of Eq. 4: the variance by which squared differences are divided.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub enum Bandwidth {
    /// The bandwidth of random parameter filtering: the neighbourhood's variance times 8 σ₈² ∕ (n (1 − W_c^r)²).
    /// It grows with the randomness of the colour. The spatial standard deviation is a quarter of the window.
    RpfSigma {
        /// σ₈². Published: 0.02 for path-traced indoor scenes, 0.002 for others.
        sigma8_squared: f32,
    },
    /// The text of Eq. 4: differences of normalised values over the variance of the pixel's own samples, which is not
    /// normalised, so that the image depends on exposure and on the scene's units. The spatial standard deviation is a
    /// twelfth of the window: 1∕√12 of a pixel over the window's positions.
    Literal,
    /// The variance of the pixel's own mean, so that converged pixels are not blurred. The spatial standard
    /// deviation is a twelfth of the window.
    MeanVariance {
        /// Bandwidth in units of the variance; 8 equals the literal formula at 8 samples per pixel.
        kappa: f32,
        /// Fraction of the neighbourhood's variance that is added.
        rho: f32,
    },
}

/// Constants of the method.
#[derive(Clone, Debug, serde::Serialize)]
pub struct PrpfSettings {
    /// Window sizes of the passes, in pixels. Paper: 55, 35, 17, 7.
    pub windows: Vec<usize>,
    /// Similarity threshold of normals and albedos within a cluster, in standard deviations. Paper: 3.
    pub z: f32,
    /// Similarity threshold of world positions, in standard deviations. Paper: 30.
    pub z_world: f32,
    /// Absolute similarity threshold of normals and albedos with a smaller standard deviation than this.
    /// Random parameter filtering: 0.1.
    pub min_threshold: f32,
    /// The same for world positions, which are divided by the scene's size.
    pub min_threshold_world: f32,
    pub bandwidth: Bandwidth,
    /// Growth per pass of the factors of W^r. Paper: 0.1.
    pub randomness_growth: f32,
    /// Factor of W_c^r in α. Paper: 2.
    pub colour_damping: f32,
    /// Spacing of the nodes of the sparse grid, in pixels. Paper: 5.
    pub grid_spacing: usize,
    /// Sum of interpolation weights at or below which interpolation fails. Paper: 0.1.
    pub interpolation_threshold: f32,
    /// Whether α and β are interpolated between grid nodes. Otherwise they are computed at every pixel.
    pub upsampling: bool,
    /// Maximum number of samples in an estimate of mutual information. Paper: all samples of the neighbourhood.
    /// 8192, which is nearly all, leave 0.93 to 1.01 times the error of 2048 (`experiments/results/paper`), and 512 leave 1.02 to 1.06 times
    /// in the mean, 0.76 to 1.5 times by scene.
    pub mi_samples: usize,
    /// Size of window from which on only every second row contributes to the filtered value. Paper: no window. It
    /// changes the image's error by −4 to 5 %.
    pub alternate_rows_from: usize,
    /// Maximum number of columns and rows of a window that contribute to the neighbourhood's statistics. Paper:
    /// all. 9 give standard deviations within about 8 %.
    pub statistics_side: usize,
    pub fireflies: FireflySettings,
}

impl PrpfSettings {
    /// The published method.
    pub fn paper() -> Self {
        Self {
            windows: vec![55, 35, 17, 7],
            z: 3.0,
            z_world: 30.0,
            min_threshold: 0.1,
            min_threshold_world: 0.001,
            bandwidth: Bandwidth::RpfSigma { sigma8_squared: 0.002 },
            randomness_growth: 0.1,
            colour_damping: 2.0,
            grid_spacing: 5,
            interpolation_threshold: 0.1,
            upsampling: true,
            mi_samples: 2048,
            alternate_rows_from: 35,
            statistics_side: 9,
            fireflies: FireflySettings::default(),
        }
    }

    /// One window, and fewer samples in its statistics: for passes between batches.
    pub fn interim() -> Self {
        Self { windows: vec![17], mi_samples: 256, statistics_side: 5, ..Self::paper() }
    }

    /// Margin of planes that passes read: half of the largest window, and at least as far as a vector load from
    /// any pixel reaches.
    pub fn margin(&self) -> usize {
        self.windows.iter().max().map_or(0, |window| window / 2).max(LANES - 1)
    }
}
