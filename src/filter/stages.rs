//! The stages that the paper splits a filter's time into, for whoever wants to know where it goes.

/// What a filter is busy with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Who resembles whom, and the statistics over them.
    Neighbourhoods,
    /// Mutual information, and the weights that follow from it.
    Weights,
    /// Weighted means.
    Filtering,
    /// Everything else.
    Other,
}

/// Is told of each stage that begins, on the thread that begins it; the one before it has ended there.
pub type Observer<'a> = &'a (dyn Fn(Stage) + Sync);
