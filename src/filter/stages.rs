//! The stages by which the paper breaks down the time of a filter, and a callback to measure them.

/// A stage of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Finding similar pixels or samples, and the statistics over them.
    Neighbourhoods,
    /// Mutual information, and the weights of features and colours.
    Weights,
    /// Weighted means.
    Filtering,
    /// All other steps.
    Other,
}

/// Callback at the start of each stage, which is the end of the previous one, on the thread that executes it.
pub type Observer<'a> = &'a (dyn Fn(Stage) + Sync);
