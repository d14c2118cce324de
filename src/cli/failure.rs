//! How a command fails, and with which exit status.

/// An error, with the exit status that it leads to.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line or an input file: 2.
    Input(anyhow::Error),
    /// Everything else: 1.
    Run(anyhow::Error),
}

impl Failure {
    /// Returns the exit status.
    pub fn status(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Run(_) => 1,
        }
    }

    pub fn error(&self) -> &anyhow::Error {
        let (Self::Input(error) | Self::Run(error)) = self;
        error
    }
}
