//! A claim of the paper, and its test on the measured scenes.

use crate::paper::scene_results::SceneResults;
use crate::paper::stage_timer::STAGES;
use crate::report::number;
use crate::statistics::Interval;

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
    /// Number of scenes on which the seeds do not decide whether it holds.
    pub undecided: usize,
    /// Number of scenes on which it was tested.
    pub tested: usize,
    /// Explains why the claim fails on the other scenes, or remarks on one that fails on none.
    pub explanation: String,
}

impl Claim {
    /// The entry of the column `holds`.
    pub fn verdict(&self) -> String {
        let verdict = match (self.holds, self.tested) {
            (_, 0) => return "not measured".to_owned(),
            (holds, tested) if holds == tested => return "holds".to_owned(),
            (0, _) if self.undecided == 0 => return "no".to_owned(),
            (holds, tested) => format!("on {holds} of {tested}"),
        };
        match self.undecided {
            0 => verdict,
            undecided => format!("{verdict}, undecided on {undecided}"),
        }
    }
}

/// This fraction of the paper's figure suffices; of an upper limit its inverse.
pub const SUFFICIENT_FRACTION: f64 = 0.9;

/// The scenes that a claim is about.
#[derive(Clone, Copy, PartialEq)]
pub enum Scope {
    All,
    One(&'static str),
}

/// Writes an explanation from the measurements on some scenes.
pub type Explain<'a> = &'a dyn Fn(&[&SceneResults]) -> String;

/// Whether a claim on a quantity of at most `limit` holds: undecided if the limit lies in the quantity's interval, or
/// if a single seed leaves that unknown.
pub fn is_at_most(interval: Interval, limit: f64) -> Option<bool> {
    if interval.high <= limit {
        Some(true)
    } else if interval.low > limit {
        Some(false)
    } else {
        None
    }
}

/// Whether a claim on a quantity of at least `limit` holds, likewise.
pub fn is_at_least(Interval { mean, low, high }: Interval, limit: f64) -> Option<bool> {
    is_at_most(Interval { mean: -mean, low: -high, high: -low }, -limit)
}

/// A claim that one value of each scene decides.
pub struct ClaimTest<'a> {
    pub claim: &'static str,
    pub paper: &'static str,
    pub scope: Scope,
    pub value: &'a dyn Fn(&SceneResults) -> f64,
    /// Whether the claim holds; `None` if the seeds do not decide it.
    pub holds: &'a dyn Fn(&SceneResults) -> Option<bool>,
    pub format: &'a dyn Fn(f64) -> String,
    /// The same value for `nlm`.
    pub nlm: Option<&'a dyn Fn(&SceneResults) -> f64>,
    /// Explains failures.
    pub explain: Explain<'a>,
    /// Remarks on a claim that fails on no scene.
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
        let with = |verdict: Option<bool>| -> Vec<&SceneResults> {
            known.iter().copied().filter(|scene| (self.holds)(scene) == verdict).collect()
        };
        let failing = with(Some(false));

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
            holds: with(Some(true)).len(),
            undecided: with(None).len(),
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

/// Formats a ratio with its interval: `2.5× (2.1 to 3.0)`.
pub fn format_interval(interval: Interval) -> String {
    if interval.low.is_finite() {
        let [low, high] = [interval.low, interval.high].map(|value| number(value, 2));
        format!("{} ({low} to {high})", format_times(interval.mean))
    } else {
        format_times(interval.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_that_holds_the_limit_decides_nothing() {
        let interval = |low, high| Interval { mean: 1.0, low, high };
        assert_eq!(is_at_most(interval(0.8, 1.0), 1.1), Some(true));
        assert_eq!(is_at_most(interval(1.2, 1.5), 1.1), Some(false));
        assert_eq!(is_at_most(interval(1.0, 1.2), 1.1), None);
        assert_eq!(is_at_most(interval(f64::NAN, f64::NAN), 1.1), None);
        assert_eq!(is_at_least(interval(1.1, 1.2), 1.1), Some(true));
        assert_eq!(is_at_least(interval(0.9, 1.0), 1.1), Some(false));
        assert_eq!(is_at_least(interval(1.0, 1.2), 1.1), None);
        assert_eq!(format_interval(interval(0.8, 1.26)), "1.0× (0.80 to 1.3)");
    }

    #[test]
    fn a_verdict_counts_the_scenes_that_are_not_decided() {
        let claim = |holds, undecided, tested| Claim {
            claim: "",
            paper: "",
            ours: Default::default(),
            nlm: String::new(),
            holds,
            undecided,
            tested,
            explanation: String::new(),
        };
        assert_eq!(claim(3, 0, 3).verdict(), "holds");
        assert_eq!(claim(0, 0, 3).verdict(), "no");
        assert_eq!(claim(1, 0, 3).verdict(), "on 1 of 3");
        assert_eq!(claim(0, 2, 3).verdict(), "on 0 of 3, undecided on 2");
    }
}
