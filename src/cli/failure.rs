//! How a command fails, and with which exit status.

/// An error, with the exit status that it leads to.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line or an input file: 2.
    Input(anyhow::Error),
    /// Everything else: 1.
    Run(anyhow::Error),
}
