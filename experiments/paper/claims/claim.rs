//! A claim of the paper, and its test on the measured scenes.

use crate::paper::scene_results::SceneResults;
use crate::paper::stage_timer::STAGES;
use crate::report::number;

/// A claim with its result.
pub struct Claim {
    pub claim: &'static str,
    /// The paper's figure, quoted.
    pub paper: &'static str,
    /// Our figures on the paper's scenes, and on our scenes.
    pub ours: [String; 2],
    /// The figure of `nlm`; empty where the claim does not apply to it.
    pub nlm: String,
    /// Number of scenes on which the claim holds.
    pub holds: usize,
    /// Number of scenes on which it was tested.
    pub tested: usize,
    /// Explains why the claim fails on the other scenes, or remarks on why it holds.
    pub explanation: String,
}

impl Claim {
    /// The entry of the column `holds`.
    pub fn verdict(&self) -> String {
        match (self.holds, self.tested) {
            (_, 0) => "not measured".to_owned(),
            (holds, tested) if holds == tested => "holds".to_owned(),
            (0, _) => "no".to_owned(),
            (holds, tested) => format!("on {holds} of {tested}"),
        }
    }
}

/// The scenes that a claim is about.
#[derive(Clone, Copy, PartialEq)]
pub enum Scope {
    All,
    One(&'static str),
}

/// Writes an explanation from the measurements on some scenes.
pub type Explain<'a> = &'a dyn Fn(&[&SceneResults]) -> String;

/// A claim that one value of each scene decides.
pub struct ClaimTest<'a> {
    pub claim: &'static str,
    pub paper: &'static str,
    pub scope: Scope,
    pub value: &'a dyn Fn(&SceneResults) -> f64,
    pub holds: &'a dyn Fn(&SceneResults) -> bool,
    pub format: &'a dyn Fn(f64) -> String,
    /// The same value for `nlm`.
    pub nlm: Option<&'a dyn Fn(&SceneResults) -> f64>,
    /// Explains failures.
    pub explain: Explain<'a>,
    /// Remarks on a claim that holds everywhere.
    pub remark: Option<Explain<'a>>,
}

impl ClaimTest<'_> {
    /// Tests the claim on the scenes whose values were measured.
    pub fn evaluate(&self, scenes: &[SceneResults]) -> Claim {
        // Select the scenes, and those on which the claim fails
        let is_in_scope = |scene: &&SceneResults| match self.scope {
            Scope::All => true,
            Scope::One(name) => scene.name == name,
        };
        let known: Vec<&SceneResults> =
            scenes.iter().filter(is_in_scope).filter(|scene| (self.value)(scene).is_finite()).collect();
        let failing: Vec<&SceneResults> =
            known.iter().copied().filter(|scene| !(self.holds)(scene)).collect();

        // Format the figures
        let figures = |from_paper: bool| {
            let group = known.iter().filter(|scene| scene.from_paper == from_paper);
            format_min_to_max(group.map(|scene| (self.value)(scene)), self.format)
        };
        let nlm = self.nlm.map_or_else(String::new, |value| {
            format_min_to_max(known.iter().map(|scene| value(scene)), self.format)
        });

        // Name the failing scenes unless all fail
        let prefix = if failing.len() == known.len() {
            String::new()
        } else {
            let names: Vec<&str> = failing.iter().map(|scene| scene.name.as_str()).collect();
            format!("{}: ", names.join(", "))
        };
        Claim {
            claim: self.claim,
            paper: self.paper,
            ours: [figures(true), figures(false)],
            nlm,
            holds: known.len() - failing.len(),
            tested: known.len(),
            explanation: match self.remark {
                _ if !failing.is_empty() => format!("{prefix}{}", (self.explain)(&failing)),
                Some(remark) if !known.is_empty() => remark(&known),
                _ => String::new(),
            },
        }
    }
}

/// Formats the range of the finite values, from the smallest to the largest.
fn format_min_to_max(values: impl Iterator<Item = f64>, format: &dyn Fn(f64) -> String) -> String {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let min = values.iter().copied().fold(f64::INFINITY, f64::min);
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let [min, max] = [min, max].map(format);
    if values.is_empty() {
        "–".to_owned()
    } else if min == max {
        min
    } else {
        format!("{min} to {max}")
    }
}

/// Formats the range of a value over some scenes.
pub fn format_range(
    scenes: &[&SceneResults],
    value: impl Fn(&SceneResults) -> f64,
    format: &dyn Fn(f64) -> String,
) -> String {
    format_min_to_max(scenes.iter().map(|scene| value(scene)), format)
}

/// Formats the fractions of a run's time in each stage.
pub fn stage_fractions(scenes: &[&SceneResults], run: &str) -> String {
    let fraction = |stage: &str| format_range(scenes, |scene| scene.get(run, stage), &format_percent);
    STAGES.map(|stage| format!("{stage} {}", fraction(stage))).join(", ")
}

/// Formats a ratio: `2.5×`.
pub fn format_times(value: f64) -> String {
    format!("{}×", number(value, 2))
}

/// Formats a fraction: `25 %`.
pub fn format_percent(value: f64) -> String {
    format!("{:.0} %", 100.0 * value)
}

/// Formats a number with two digits.
pub fn format_number(value: f64) -> String {
    number(value, 2)
}
