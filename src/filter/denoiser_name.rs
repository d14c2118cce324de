//! The names of denoisers, as image files, reports, states, command line and page show them.

/// The name of a denoiser.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct DenoiserName {
    /// As `--denoiser` takes it.
    #[serde(rename = "denoiser")]
    pub method: &'static str,
    /// As `--quality` takes it; `None` for a method without presets.
    #[serde(rename = "quality", skip_serializing_if = "Option::is_none")]
    pub preset: Option<&'static str>,
}

impl std::fmt::Display for DenoiserName {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self.preset {
            Some(preset) => write!(f, "{} {preset}", self.method),
            None => f.write_str(self.method),
        }
    }
}
