//! Compares the measurements of `allocation` with the project's goals.

use super::ablation::{ALL_MAPS, ORACLE};
use super::report::{FILTERED, ablated, format_interval, names, over_scenes, ratio};
use super::scene_results::SceneResults;
use super::settings::Settings;
use crate::curves::{EqualCost, Metric};
use crate::report::{Goal, median, number};
use crate::statistics::{Interval, geometric_mean};
use crate::test_scene::groups;

/// Compares the measurements with the project's goals.
pub fn goals(settings: &Settings, all: &[SceneResults]) -> Vec<Goal> {
    const FIRST_SPP: u32 = 16;
    const RATIO: f64 = 0.75;
    const LARGEST_RATIO: f64 = 1.02;
    const FRACTION: f64 = 0.8;

    // Compare with uniform sampling
    let spps = || settings.spp.iter().copied().filter(|&spp| spp >= FIRST_SPP);
    let over_groups = |error: Metric| -> Vec<Interval> {
        let groups = groups(all, |m| m.is_public);
        let of_group = |(_, scenes): &(&str, Vec<&SceneResults>)| {
            spps()
                .map(|spp| over_scenes(error, scenes, spp, FILTERED, EqualCost::Seconds))
                .collect::<Vec<_>>()
        };
        groups.iter().flat_map(of_group).collect()
    };
    let list = |intervals: &[Interval]| {
        let means = intervals.iter().map(|interval| format!("{:.2}", interval.mean));
        means.collect::<Vec<_>>().join(", ")
    };
    let (relmse, flip) = (over_groups(|p| p.error), over_groups(|p| p.flip));
    let is_larger = |m: &SceneResults| {
        spps().any(|spp| ratio(|p| p.error, m, spp, FILTERED, EqualCost::Seconds).low > LARGEST_RATIO)
    };

    // Compare the maps with the true error
    let fractions = all.iter().filter_map(|m| {
        let [reached, possible] = maps_and_true_error(m);
        gain_fraction(reached.mean, possible.mean)
    });
    let fraction = median(fractions);

    // List the goals
    vec![
        Goal {
            goal: format!(
                "relMSE at most {RATIO} of uniform sampling's in the mean, filtered, at equal seconds, from {FIRST_SPP} spp on"
            ),
            measured: list(&relmse),
            is_met: relmse.iter().all(|interval| interval.mean <= RATIO),
        },
        Goal {
            goal: format!("above {LARGEST_RATIO} beyond its interval on no scene, likewise"),
            measured: format!("on {}", names(all, &is_larger)),
            is_met: !all.iter().any(is_larger),
        },
        Goal {
            goal: "ꟻLIP not larger beyond its interval in the mean, likewise".to_owned(),
            measured: flip.iter().copied().map(format_interval).collect::<Vec<_>>().join(", "),
            is_met: !flip.iter().any(|interval| interval.low > 1.0),
        },
        Goal {
            goal: format!("{FRACTION} of what the loop gains with the true error, median of the scenes"),
            measured: number(fraction, 2),
            is_met: fraction >= FRACTION,
        },
    ]
}

/// Ratios to the error of uniform sampling at equal samples: of the loop whose samples follow the maps, and the true error.
pub fn maps_and_true_error(m: &SceneResults) -> [Interval; 2] {
    [ALL_MAPS, ORACLE].map(|name| geometric_mean(&ablated(m).ratios(name, EqualCost::Samples)))
}

/// Returns the fraction of a possible gain that is reached; `None` where the possible one is noise.
pub fn gain_fraction(reached: f64, possible: f64) -> Option<f64> {
    /// Fractions of smaller gains are noise.
    const MIN_GAIN: f64 = 0.05;
    (1.0 - possible >= MIN_GAIN).then(|| (1.0 - reached) / (1.0 - possible))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_is_a_negative_fraction_and_a_small_possible_gain_is_noise() {
        let fraction = |reached, possible| gain_fraction(reached, possible).map(|v| (100.0 * v).round());
        assert_eq!(fraction(0.6, 0.5), Some(80.0));
        assert_eq!(fraction(1.1, 0.8), Some(-50.0));
        assert_eq!(fraction(0.6, 0.96), None);
    }
}
