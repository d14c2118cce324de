//! What several tests look at.

/// A box with a lens, a lamp that is seen, and a glossy and a rough ball: noise of several kinds, at a size
/// that takes about a second.
pub const SCENE: &str = include_str!("../../experiments/stability/cases/noisy.pbrt");
