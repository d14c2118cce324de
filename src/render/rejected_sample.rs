//! A sample that the pixel-statistics store rejected.

/// Identifies a sample that was rejected because a value was not finite or too large, or a radiance negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RejectedSample {
    /// Row of the film's pixel bounds.
    pub y: usize,
    /// Column of the film's pixel bounds.
    pub x: usize,
    /// Index among the renderer's samples of the pixel.
    pub index: u32,
}
