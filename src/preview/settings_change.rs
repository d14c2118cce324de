//! Settings that the page changes while the render runs.

use serde::Deserialize;

use crate::adaptive::Sampling;
use crate::filter::{self, DENOISERS, Denoiser, DenoiserName};
use crate::progressive::Settings;

/// Largest value of a budget.
const LARGEST_BUDGET: f64 = 1e9;

/// New values of some settings; absent ones stay. A budget of 0 is off.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettingsChange {
    pub sampling: Option<Sampling>,
    /// Method of the denoiser.
    pub denoiser: Option<String>,
    /// Preset of the denoiser; without one a new method has its default.
    pub quality: Option<String>,
    /// Samples per pixel, on average over the image.
    pub spp: Option<u32>,
    pub seconds: Option<f64>,
    /// Relative mean squared error of the image (relMSE).
    pub target_error: Option<f64>,
}

impl SettingsChange {
    /// Returns the denoiser, where the current one is `current`; `None` if there is none of these names that this
    /// machine can use.
    fn find_denoiser(&self, current: &'static dyn Denoiser) -> Option<&'static dyn Denoiser> {
        let found = match (self.denoiser.as_deref(), self.quality.as_deref()) {
            (None, None) => Some(current),
            (Some(method), quality) => filter::find(method, quality),
            (None, quality) => filter::find(current.name().method, quality),
        };
        found.filter(|denoiser| denoiser.missing().is_none())
    }

    /// Changes `settings`; returns whether the method of the denoiser changes. A preset that the denoiser does not have
    /// changes nothing.
    pub fn apply(&self, settings: &mut Settings) -> bool {
        let positive = |value: f64| Some(value).filter(|v| *v > 0.0);
        let before = settings.denoiser.name().method;
        settings.denoiser = self.find_denoiser(settings.denoiser).unwrap_or(settings.denoiser);
        settings.sampling = self.sampling.unwrap_or(settings.sampling);
        if let Some(spp) = self.spp {
            settings.budget.spp = Some(spp).filter(|spp| *spp > 0);
        }
        if let Some(seconds) = self.seconds {
            settings.budget.seconds = positive(seconds);
        }
        if let Some(error) = self.target_error {
            settings.budget.target_error = positive(error);
        }
        settings.denoiser.name().method != before
    }

    /// Checks that the denoiser exists and that all budgets are in range.
    ///
    /// # Errors
    /// One line that names the setting and its range.
    pub fn check(&self) -> Result<(), String> {
        let (method, quality) = (self.denoiser.as_deref(), self.quality.as_deref());
        let matches = |name: DenoiserName| {
            method.is_none_or(|method| name.method == method)
                && quality.is_none_or(|quality| name.preset == Some(quality))
        };
        if !DENOISERS.into_iter().any(|d| d.missing().is_none() && matches(d.name())) {
            let [method, quality] = [method, quality].map(Option::unwrap_or_default);
            return Err(format!("no denoiser `{method}` of quality `{quality}`"));
        }
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
