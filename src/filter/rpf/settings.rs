//! Constants of random parameter filtering, and where those who published it differ.

/// One pass.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct RpfPass {
    /// Side of the window b, in pixels.
    pub window: usize,
    /// Samples of a neighbourhood, before those that differ are left out, over the b²·n of its window.
    pub share: f32,
}

/// Constants of the method.
#[derive(Clone, Debug, serde::Serialize)]
pub struct RpfSettings {
    pub passes: Vec<RpfPass>,
    /// The deviation of draws is (b − this) ∕ 4 pixels …
    pub window_trim: f32,
    /// … and at least this.
    pub least_deviation: f32,
    /// A pixel is drawn no more often than it has samples.
    pub draws_capped: bool,
    /// Deviations that a neighbourhood's normals and albedos may be apart.
    pub z: f32,
    /// The same for world positions.
    pub z_world: f32,
    /// Normals and albedos that vary less than this within a pixel may always be this far apart.
    pub tolerance: f32,
    /// The same for world positions, which are of order 1.
    pub tolerance_world: f32,
    /// Whether features of the second hit decide on neighbours.
    pub second_hit_decides: bool,
    /// α = max(1 − (first + growth·t) W_c^r, 0): first and growth.
    pub colour_damping: [f32; 2],
    /// β likewise, by W_f^r.
    pub feature_damping: [f32; 2],
    /// What β is multiplied by at albedos and at normals.
    pub boosts: [f32; 2],
    /// σ₈²: variance that colours and features are filtered with at 8 samples a pixel.
    pub sigma8_squared: f32,
    pub spikes: SpikeSettings,
}

/// What becomes of a filtered sample that stands out from its pixel's.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct SpikeSettings {
    /// A sample stands out by more than this many deviations in any channel.
    pub deviations: f32,
    /// Only bright ones stand out; they are brought to the limit, channel by channel, not to the mean.
    pub clamp_bright: bool,
    /// What the mean of the pixel loses is added to all its samples.
    pub keep_energy: bool,
}

impl RpfSettings {
    /// As published: the paper and its technical report.
    pub fn report() -> Self {
        Self {
            passes: [55, 35, 17, 7].map(|window| RpfPass { window, share: 0.5 }).to_vec(),
            window_trim: 0.0,
            least_deviation: 0.0,
            draws_capped: false,
            z: 3.0,
            z_world: 30.0,
            tolerance: 0.1,
            tolerance_world: 0.001,
            second_hit_decides: true,
            colour_damping: [2.0, 0.2],
            feature_damping: [1.0, 0.1],
            boosts: [1.0, 1.0],
            sigma8_squared: 0.002,
            spikes: SpikeSettings { deviations: 1.0, clamp_bright: false, keep_energy: false },
        }
    }

    /// As in the code that the authors released in 2015. Not taken over: its histograms of up to ten
    /// bins, and its limit of 10 on radiance, which depends on the exposure.
    pub fn release() -> Self {
        const THIRD: f32 = 1.0 / 3.0;
        Self {
            passes: [(45, THIRD), (30, THIRD), (15, 0.5), (5, 0.5)]
                .map(|(window, share)| RpfPass { window, share })
                .to_vec(),
            window_trim: 1.0,
            least_deviation: 1.0,
            draws_capped: true,
            z_world: 50.0,
            second_hit_decides: false,
            colour_damping: [5.2, 0.2],
            boosts: [25.0, 10.0],
            sigma8_squared: 0.05,
            spikes: SpikeSettings { deviations: 0.5, clamp_bright: true, keep_energy: false },
            ..Self::report()
        }
    }

    /// As in the code of Lehtinen et al. 2012 (*Reconstructing the indirect light field*), which calls the
    /// report's factor of 2 an error and keeps the energy of spikes.
    pub fn lehtinen() -> Self {
        let report = Self::report();
        Self {
            colour_damping: [1.0, 0.1],
            spikes: SpikeSettings { keep_energy: true, ..report.spikes },
            ..report
        }
    }
}
