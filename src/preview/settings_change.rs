//! Settings that the page changes while the render runs.

use serde::Deserialize;

use crate::adaptive::Sampling;
use crate::filter::Quality;
use crate::progressive::{Denoiser, Settings};

/// Largest value of a budget.
const LARGEST_BUDGET: f64 = 1e9;

/// New values of some settings; absent ones stay. A budget of 0 is off.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettingsChange {
    pub sampling: Option<Sampling>,
    pub denoiser: Option<Denoiser>,
    pub quality: Option<Quality>,
    /// Samples per pixel, on average over the image.
    pub spp: Option<u32>,
    pub seconds: Option<f64>,
    /// Relative mean squared error of the image (relMSE).
    pub target_error: Option<f64>,
}

impl SettingsChange {
    /// Changes `settings`; returns whether the denoiser changes.
    pub fn apply(&self, settings: &mut Settings) -> bool {
        let positive = |value: f64| Some(value).filter(|v| *v > 0.0);
        let before = settings.denoiser;
        settings.denoiser = self.denoiser.unwrap_or(before);
        settings.sampling = self.sampling.unwrap_or(settings.sampling);
        settings.quality = self.quality.unwrap_or(settings.quality);
        if let Some(spp) = self.spp {
            settings.budget.spp = Some(spp).filter(|spp| *spp > 0);
        }
        if let Some(seconds) = self.seconds {
            settings.budget.seconds = positive(seconds);
        }
        if let Some(error) = self.target_error {
            settings.budget.target_error = positive(error);
        }
        settings.denoiser != before
    }

    /// Checks that all budgets are in range.
    ///
    /// # Errors
    /// One line that names the setting and its range.
    pub fn check(&self) -> Result<(), String> {
        let budgets = [
            ("spp", self.spp.map(f64::from)),
            ("seconds", self.seconds),
            ("target_error", self.target_error),
        ];
        for (name, value) in budgets {
            if value.is_some_and(|v| !(0.0..=LARGEST_BUDGET).contains(&v)) {
                return Err(format!("`{name}` has to be from 0 (off) to {LARGEST_BUDGET:e}"));
            }
        }
        Ok(())
    }
}
