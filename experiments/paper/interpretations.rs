//! Lists other interpretations of what the papers leave open, and alternative settings of both methods.

use prpf::filter::{Bandwidth, FireflySettings, PrpfSettings, RpfSettings};

use super::method::Method;

/// The settings of P-RPF as published.
pub fn published(sigma8_squared: f32) -> PrpfSettings {
    PrpfSettings { bandwidth: Bandwidth::RpfSigma { sigma8_squared }, ..PrpfSettings::paper() }
}

/// The settings of RPF that P-RPF is compared with.
pub fn compared_rpf(sigma8_squared: f32) -> RpfSettings {
    RpfSettings { sigma8_squared, ..RpfSettings::energy_kept() }
}

/// The settings of RPF to the letter of its report.
pub fn letter_rpf(sigma8_squared: f32) -> RpfSettings {
    RpfSettings { sigma8_squared, ..RpfSettings::report() }
}

/// Names of interpretations that explain claims.
pub const ALL_PIXELS: &str = "P-RPF, statistics of all pixels of a window";
pub const LITERAL: &str = "P-RPF, Eq. 4 to the letter";
pub const RELEASE: &str = "RPF, the authors' code of 2015";
pub const LETTER_OF_REPORT: &str = "RPF, to the letter of its report: the energy of fireflies lost";

/// All interpretations of both methods: a name, and the method.
pub fn interpretations(sigma8_squared: f32) -> Vec<(&'static str, Method)> {
    // Interpretations of P-RPF
    let (outdoor, indoor) = (0.002, 0.02);
    let other = if sigma8_squared > outdoor { outdoor } else { indoor };
    let base = published(sigma8_squared);
    let whole_window = base.windows.iter().copied().max().unwrap_or(1);
    let mean_variance = Bandwidth::MeanVariance { kappa: 8.0, rho: 1e-3 };
    let prpf = |settings| Method::Prpf(settings);
    let mut interpretations = vec![
        ("P-RPF, the other σ₈² (0.002 or 0.02)", prpf(published(other))),
        (LITERAL, prpf(PrpfSettings { bandwidth: Bandwidth::Literal, ..base.clone() })),
        (
            "P-RPF, Eq. 4 by the variance of the pixel's mean",
            prpf(PrpfSettings { bandwidth: mean_variance, ..base.clone() }),
        ),
        (ALL_PIXELS, prpf(PrpfSettings { statistics_side: whole_window, ..base.clone() })),
        (
            "P-RPF, mutual information of at most 512 samples",
            prpf(PrpfSettings { mi_samples: 512, ..base.clone() }),
        ),
        (
            "P-RPF, mutual information of at most 8192 samples",
            prpf(PrpfSettings { mi_samples: 8192, ..base.clone() }),
        ),
        (
            "P-RPF, without firefly handling",
            prpf(PrpfSettings { fireflies: FireflySettings::off(), ..base.clone() }),
        ),
        ("P-RPF, positions up to 50 standard deviations apart", prpf(PrpfSettings { z_world: 50.0, ..base })),
    ];

    // Interpretations of RPF
    interpretations.extend([
        ("RPF, the other σ₈² (0.002 or 0.02)", Method::Rpf(compared_rpf(other))),
        (LETTER_OF_REPORT, Method::Rpf(letter_rpf(sigma8_squared))),
        (RELEASE, Method::Rpf(RpfSettings::release())),
        (
            "RPF, the code of Lehtinen et al. 2012",
            Method::Rpf(RpfSettings { sigma8_squared, ..RpfSettings::lehtinen() }),
        ),
    ]);
    interpretations
}
