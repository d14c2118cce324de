//! Selects how much a case tries: what a test can afford, or everything.

/// The extent of cases that can be tried on more or less input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    Test,
    Full,
}

impl Effort {
    /// The value for this effort.
    pub fn select<T>(self, test: T, full: T) -> T {
        match self {
            Self::Test => test,
            Self::Full => full,
        }
    }
}
