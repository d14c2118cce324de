//! Colour scales of the page's maps.

use serde::Serialize;

/// The range of values that a colour map shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColourScale {
    /// Name of the quantity and its unit, for the legend.
    pub unit: &'static str,
    /// How colours are spaced between `low` and `high`.
    pub curve: Curve,
    pub low: f32,
    pub high: f32,
    /// A value that the legend marks, such as a budget or a target.
    pub mark: Option<f32>,
}

/// The function that is linear along a colour scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Curve {
    Linear,
    Log2,
    Log10,
}
