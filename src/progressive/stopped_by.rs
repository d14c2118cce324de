//! Names the limit that ended a render.

/// The limit that ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StoppedBy {
    Spp,
    Time,
    TargetError,
    Interrupt,
}

impl std::fmt::Display for StoppedBy {
    /// Writes the limit as the report has it.
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::Spp => "spp",
            Self::Time => "time",
            Self::TargetError => "target-error",
            Self::Interrupt => "interrupt",
        })
    }
}
