//! The two ways to render.

/// The command that renders.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Ends by a budget, and writes its outputs.
    Render,
    /// Stays until it is interrupted, and writes images when a viewer saves them.
    Preview,
}
