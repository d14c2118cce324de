//! The choice between all samples of a pixel and one of the two independent halves.

/// The samples of a pixel to read: all of them, or the half of even (0) or odd (1) index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Whole,
    /// Index 0 or 1.
    Half(usize),
}
