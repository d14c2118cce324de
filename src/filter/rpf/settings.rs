//! Constants of random parameter filtering, as published and as in two implementations that differ.

/// Constants of a pass.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct RpfPass {
    /// Size b of the window, in pixels.
    pub window: usize,
    /// Size of a neighbourhood before clustering, relative to the b²·n samples of its window.
    pub fraction: f32,
}

/// Constants of the method.
#[derive(Clone, Debug, serde::Serialize)]
pub struct RpfSettings {
    pub passes: Vec<RpfPass>,
    /// The standard deviation of candidates is (b − `window_trim`) ∕ 4 pixels …
    pub window_trim: f32,
    /// … and at least this.
    pub min_deviation: f32,
    /// Whether a pixel is selected at most as often as it has samples.
    pub cap_candidates: bool,
    /// Similarity threshold of normals and albedos, in standard deviations.
    pub z: f32,
    /// Similarity threshold of world positions, in standard deviations.
    pub z_world: f32,
    /// Absolute similarity threshold of normals and albedos with a smaller standard deviation than this.
    pub min_threshold: f32,
    /// The same for world positions, which are divided by the scene's size.
    pub min_threshold_world: f32,
    /// Whether clustering compares features of the second hit.
    pub cluster_second_hit: bool,
    /// Factor of W_c^r in α in the first pass, and its growth per pass: α = max(1 − (first + growth·t) W_c^r, 0).
    pub colour_damping: [f32; 2],
    /// The same for W_f^r in β.
    pub feature_damping: [f32; 2],
    /// Factors of β for albedos and for normals.
    pub feature_boosts: [f32; 2],
    /// σ₈²: variance of the filter of colours and features at 8 samples per pixel.
    pub sigma8_squared: f32,
    pub fireflies: RpfFireflySettings,
}

/// Treatment of fireflies among the filtered samples of a pixel.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct RpfFireflySettings {
    /// Deviation from the mean, in standard deviations of any channel, above which a sample is a firefly.
    pub deviations: f32,
    /// Whether only bright samples are fireflies; they are clamped to the limit in each channel instead of
    /// replaced by the mean.
    pub clamp_bright: bool,
    /// Whether the loss of the mean is added to all samples of the pixel.
    pub keep_energy: bool,
}

impl RpfSettings {
    /// The method that `rpf` stands for: the technical report, whose step against fireflies keeps the energy.
    ///
    /// The report's own step loses it ([`RpfSettings::report`]): a loss that samples do not reduce, so that the error
    /// does not fall as its authors show. Lehtinen et al. (2012) return the loss to the pixel in their code.
    pub fn energy_kept() -> Self {
        let report = Self::report();
        Self { fireflies: RpfFireflySettings { keep_energy: true, ..report.fireflies }, ..report }
    }

    /// The technical report to the letter.
    pub fn report() -> Self {
        Self {
            passes: [55, 35, 17, 7].map(|window| RpfPass { window, fraction: 0.5 }).to_vec(),
            window_trim: 0.0,
            min_deviation: 0.0,
            cap_candidates: false,
            z: 3.0,
            z_world: 30.0,
            min_threshold: 0.1,
            min_threshold_world: 0.001,
            cluster_second_hit: true,
            colour_damping: [2.0, 0.2],
            feature_damping: [1.0, 0.1],
            feature_boosts: [1.0, 1.0],
            sigma8_squared: 0.002,
            fireflies: RpfFireflySettings { deviations: 1.0, clamp_bright: false, keep_energy: false },
        }
    }

    /// As in the code that the authors released in 2015, without its histograms of up to ten bins and its
    /// limit of 10 on radiance, which depends on the units of the scene.
    pub fn release() -> Self {
        const THIRD: f32 = 1.0 / 3.0;
        Self {
            passes: [(45, THIRD), (30, THIRD), (15, 0.5), (5, 0.5)]
                .map(|(window, fraction)| RpfPass { window, fraction })
                .to_vec(),
            window_trim: 1.0,
            min_deviation: 1.0,
            cap_candidates: true,
            z_world: 50.0,
            cluster_second_hit: false,
            colour_damping: [5.2, 0.2],
            feature_boosts: [25.0, 10.0],
            sigma8_squared: 0.05,
            fireflies: RpfFireflySettings { deviations: 0.5, clamp_bright: true, keep_energy: false },
            ..Self::report()
        }
    }

    /// As in the code of Lehtinen et al. 2012 (*Reconstructing the indirect light field*), which calls the
    /// report's factor of 2 an error and keeps the energy of fireflies.
    pub fn lehtinen() -> Self {
        Self { colour_damping: [1.0, 0.1], ..Self::energy_kept() }
    }
}
