//! Hard cases: what must hold where numbers, scenes or circumstances are at their worst.
//!
//! Each case is one measured figure beside its bound. The same cases are run by the tests
//! (`tests/stability.rs`), which demand that every one holds, and by `prpf-experiments stability`,
//! which writes them down. Only the library's public face is used.

mod camera;
mod circle;
mod features;
mod files;
mod images;
mod leaks;
mod light;
mod odd_stores;
mod pictures;
mod radiance;
mod scenes;
mod statistics;
mod stores;
mod surfaces;

use std::fmt;
use std::path::PathBuf;

/// What a measured figure has to be.
#[derive(Clone, Copy, Debug)]
pub enum Bound {
    Exactly(f64),
    AtMost(f64),
    AtLeast(f64),
    Between(f64, f64),
}

/// One hard case.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: String,
    /// What the figure is.
    pub figure: &'static str,
    pub bound: Bound,
    pub measured: f64,
    /// Where what was asked for cannot hold: why, and what holds instead.
    pub instead: Option<&'static str>,
}

/// How much is tried where a case can be tried on more or less: what a test can afford, or all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    Test,
    Full,
}

/// Cases that belong together.
pub struct Section {
    pub name: &'static str,
    pub cases: fn(Effort) -> Vec<Case>,
}

/// All of them.
pub const SECTIONS: [Section; 9] = [
    Section { name: "Statistics", cases: statistics::cases },
    Section { name: "Radiance", cases: radiance::cases },
    Section { name: "Features", cases: features::cases },
    Section { name: "Images", cases: images::cases },
    Section { name: "Odd stores", cases: odd_stores::cases },
    Section { name: "Scenes", cases: scenes::cases },
    Section { name: "Light and surfaces", cases: surfaces_and_light },
    Section { name: "The loop", cases: circle::cases },
    Section { name: "Files", cases: files::cases },
];

fn surfaces_and_light(effort: Effort) -> Vec<Case> {
    [surfaces::cases(effort), light::cases(effort), camera::cases(effort), leaks::cases(effort)].concat()
}

/// The built program: cargo tells tests where it is; a program finds it beside itself.
pub fn program() -> PathBuf {
    option_env!("CARGO_BIN_EXE_prpf").map(PathBuf::from).unwrap_or_else(|| {
        let own = std::env::current_exe().expect("a program has a path");
        own.with_file_name(format!("prpf{}", std::env::consts::EXE_SUFFIX))
    })
}

impl Effort {
    fn of<T>(self, test: T, full: T) -> T {
        match self {
            Self::Test => test,
            Self::Full => full,
        }
    }
}

impl Bound {
    pub fn holds(self, measured: f64) -> bool {
        match self {
            Self::Exactly(value) => measured == value,
            Self::AtMost(most) => measured <= most,
            Self::AtLeast(least) => measured >= least,
            Self::Between(least, most) => (least..=most).contains(&measured),
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Self::Exactly(value) => write!(f, "= {}", number(value)),
            Self::AtMost(most) => write!(f, "≤ {}", number(most)),
            Self::AtLeast(least) => write!(f, "≥ {}", number(least)),
            Self::Between(least, most) => write!(f, "{} … {}", number(least), number(most)),
        }
    }
}

/// Three digits, more only of whole numbers.
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

impl Case {
    fn new(name: impl Into<String>, figure: &'static str, bound: Bound, measured: f64) -> Self {
        Self { name: name.into(), figure, bound, measured, instead: None }
    }

    /// Says why the figure is not the one asked for.
    fn instead(self, reason: &'static str) -> Self {
        Self { instead: Some(reason), ..self }
    }

    /// A figure that is not a number never passes.
    pub fn passed(&self) -> bool {
        self.bound.holds(self.measured)
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let verdict = if self.passed() { "holds" } else { "FAILS" };
        write!(f, "{verdict}: {}: {} {} ({})", self.name, self.figure, number(self.measured), self.bound)?;
        self.instead.map_or(Ok(()), |reason| write!(f, "; {reason}"))
    }
}

/// The largest of some numbers; not a number if one of them is not.
fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values
        .into_iter()
        .fold(f64::NEG_INFINITY, |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) })
}

/// |a / b − 1|; 0 where both are 0.
fn relative(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a / b - 1.0).abs() }
}
