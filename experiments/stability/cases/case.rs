//! A hard case: a measured figure and its bound.

use std::fmt;

/// The values that a figure may have.
#[derive(Clone, Copy, Debug)]
pub enum Bound {
    Exactly(f64),
    AtMost(f64),
    AtLeast(f64),
    Between(f64, f64),
}

/// A hard case.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: String,
    /// Name of the figure.
    pub figure: &'static str,
    pub bound: Bound,
    pub measured: f64,
    /// Where the original requirement cannot hold: why, and what holds instead.
    pub limitation: Option<&'static str>,
}

impl Bound {
    fn holds(self, measured: f64) -> bool {
        match self {
            Self::Exactly(value) => measured == value,
            Self::AtMost(max) => measured <= max,
            Self::AtLeast(min) => measured >= min,
            Self::Between(min, max) => (min..=max).contains(&measured),
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Self::Exactly(value) => write!(f, "= {}", number(value)),
            Self::AtMost(max) => write!(f, "≤ {}", number(max)),
            Self::AtLeast(min) => write!(f, "≥ {}", number(min)),
            Self::Between(min, max) => write!(f, "{} … {}", number(min), number(max)),
        }
    }
}

impl Case {
    pub fn new(name: impl Into<String>, figure: &'static str, bound: Bound, measured: f64) -> Self {
        Self { name: name.into(), figure, bound, measured, limitation: None }
    }

    /// States why the original requirement cannot hold, and what holds instead.
    pub fn with_limitation(self, limitation: &'static str) -> Self {
        Self { limitation: Some(limitation), ..self }
    }

    /// Whether the figure is within its bound. NaN never is.
    pub fn passed(&self) -> bool {
        self.bound.holds(self.measured)
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let verdict = if self.passed() { "holds" } else { "FAILS" };
        write!(f, "{verdict}: {}: {} {} ({})", self.name, self.figure, number(self.measured), self.bound)?;
        self.limitation.map_or(Ok(()), |limitation| write!(f, "; {limitation}"))
    }
}

/// Formats a figure with three digits, or more for an integer.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value.fract() == 0.0 && size < 1e6 {
        format!("{value}")
    } else if (1e-3..1e6).contains(&size) {
        format!("{value:.*}", (2 - size.log10().floor() as i32).max(0) as usize)
    } else {
        format!("{value:.1e}")
    }
}

/// The largest value; NaN if one of them is NaN.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values
        .into_iter()
        .fold(f64::NEG_INFINITY, |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) })
}

/// Relative difference |a / b − 1|; 0 if both are 0.
pub fn relative(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a / b - 1.0).abs() }
}
