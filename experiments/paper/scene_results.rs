//! Holds the values measured on a scene, by run, seed and quantity.

use std::collections::BTreeMap;

use super::settings::RpfRuns;
use crate::ledger::Values;
use crate::statistics::{Interval, mean, ratio_of_means};

/// The measurements on a scene.
#[derive(Clone, Debug)]
pub struct SceneResults {
    pub name: String,
    /// Whether it is one of the paper's scenes, or a stand-in for one.
    pub from_paper: bool,
    /// The runs of RPF, in ascending order of sample counts.
    pub rpf_runs: Vec<RpfRuns>,
    /// Values of each run, seed by seed from 0.
    pub runs: BTreeMap<String, Vec<Values>>,
}

impl SceneResults {
    /// Adds a run with the next seed.
    pub fn add(&mut self, run: impl Into<String>, values: Values) {
        self.runs.entry(run.into()).or_default().push(values);
    }

    /// A quantity of a run, seed by seed; NaN for seeds without it.
    fn by_seed(&self, run: &str, quantity: &str) -> Vec<f64> {
        let seeds = self.runs.get(run).into_iter().flatten();
        seeds.map(|values| values.get(quantity).copied().unwrap_or(f64::NAN)).collect()
    }

    /// The mean of a quantity over the seeds that have it; NaN if none has.
    pub fn get(&self, run: &str, quantity: &str) -> f64 {
        self.interval(run, quantity).mean
    }

    /// The mean of a quantity over the seeds, and its interval.
    pub fn interval(&self, run: &str, quantity: &str) -> Interval {
        let seeds = self.runs.get(run).into_iter().flatten();
        mean(&seeds.filter_map(|values| values.get(quantity).copied()).collect::<Vec<_>>())
    }

    /// The mean of a quantity of a method at a sample count.
    pub fn at(&self, method: &str, spp: u32, quantity: &str) -> f64 {
        self.get(&at(method, spp), quantity)
    }

    /// Number of seeds of a run.
    pub fn seeds(&self, run: &str) -> usize {
        self.runs.get(run).map_or(0, Vec::len)
    }

    /// The ratio of the means of a quantity over the seeds that two runs share, and its interval.
    pub fn ratio(&self, run: &str, base: &str, quantity: &str) -> Interval {
        let pairs = self.by_seed(run, quantity).into_iter().zip(self.by_seed(base, quantity));
        ratio_of_means(&pairs.collect::<Vec<_>>())
    }

    /// Ratio of a method's MSE to that of RPF at a sample count, on RPF's pixels.
    pub fn mse_over_rpf(&self, method: &str, spp: u32) -> Interval {
        self.ratio(&beside(method, spp), &at(RPF, spp), "mse")
    }

    /// The name of the MSE on the pixels of RPF at a sample count.
    pub fn rpf_mse(&self, spp: u32) -> String {
        let runs = self.rpf_runs.iter().find(|runs| runs.spp == spp);
        mse_of_side(runs.map_or(0, |runs| runs.side))
    }

    /// The largest sample count of RPF.
    pub fn max_rpf_spp(&self) -> Option<u32> {
        self.rpf_runs.last().map(|runs| runs.spp)
    }

    /// The run of a method at a sample count: on RPF's pixels and with its seeds if RPF has that count, on the crop otherwise.
    pub fn compared_run(&self, method: &str, spp: u32) -> String {
        let is_beside = method != RPF && self.seeds(&at(RPF, spp)) > 0;
        if is_beside { beside(method, spp) } else { at(method, spp) }
    }

    /// Side of the square that all sample counts of RPF share.
    pub fn shared_rpf_side(&self) -> usize {
        self.rpf_runs.iter().map(|runs| runs.side).min().unwrap_or(0)
    }

    /// Ratio of the filter times of RPF and of a method on the same pixels.
    pub fn speed_up(&self, method: &str, spp: u32) -> Interval {
        self.ratio(&at(RPF, spp), &beside(method, spp), "seconds")
    }
}

/// The name of the run of a method at a sample count.
pub fn at(method: &str, spp: u32) -> String {
    format!("{method} {spp}")
}

/// The name of the run of a method on the pixels of RPF, directly after it.
pub fn beside(method: &str, spp: u32) -> String {
    format!("beside rpf {}", at(method, spp))
}

/// The name of the MSE on a square in the middle of the crop.
pub fn mse_of_side(side: usize) -> String {
    format!("mse {side}")
}

/// The name of the mean over the reference's mean on a square in the middle of the crop.
pub fn brightness_of_side(side: usize) -> String {
    format!("brightness {side}")
}

/// Names of methods. A run is named `METHOD SPP`. Times are in seconds per megapixel.
pub const UNFILTERED: &str = "unfiltered";
pub const PRPF: &str = "prpf";
pub const NLM: &str = "nlm";
pub const RPF: &str = "rpf";
/// The error of the reference.
pub const REFERENCE: &str = "reference";
/// P-RPF with and without upsampling of weights.
pub const UPSAMPLING: &str = "upsampling";
/// Samples beyond the similarity threshold in a selection by pixels.
pub const OUTSIDE: &str = "outside";
/// P-RPF and `nlm` on the whole image.
pub const WHOLE: &str = "whole";
/// A method in the time of RPF: `equal time METHOD`.
pub const EQUAL_TIME: &str = "equal time";
/// The quantity of such a run: its time, sampling included, over that of RPF.
pub const TIME_OVER_RPF: &str = "time over rpf";
/// RPF at the base count on the pixels of its largest count.
pub const BASE_OF_GROWTH: &str = "rpf base of growth";
/// Another interpretation of a paper: `interpretation NAME`.
pub const INTERPRETATION: &str = "interpretation";
/// RPF to the letter of its report at more samples than the base count: `letter SPP`.
pub const LETTER: &str = "letter";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ledger::values;

    #[test]
    fn ratios_are_those_of_the_seeds_that_both_runs_have() {
        let mut scene = SceneResults {
            name: "pool".into(),
            from_paper: false,
            rpf_runs: vec![RpfRuns { spp: 8, seeds: 2, side: 64 }],
            runs: Default::default(),
        };
        for mse in [1.0, 4.0] {
            scene.add("rpf 8", values([("mse 64", mse)]));
        }
        for mse in [2.0, 2.0, 1000.0] {
            scene.add("prpf 8", values([("mse 64", mse), ("mse", 1.0)]));
        }
        let ratio = scene.ratio("prpf 8", "rpf 8", "mse 64");
        assert!((ratio.mean - 0.8).abs() < 1e-12 && ratio.low < 0.5, "{ratio:?}");
        assert_eq!((scene.seeds("prpf 8"), scene.get("rpf 8", "mse 64")), (3, 2.5));
        // One seed alone has the quantity
        scene.add("rpf 8", values([("mse 64", 4.0), ("weights mse", 0.5)]));
        assert_eq!(scene.get("rpf 8", "weights mse"), 0.5);
        assert!(scene.get("prpf 16", "mse").is_nan() && scene.mse_over_rpf("prpf", 16).mean.is_nan());
        // Beside RPF counts what was run on its pixels
        for (seconds, mse) in [(1.0, 2.0), (2.0, 6.0)] {
            scene.add("rpf 16", values([("seconds", 8.0 * seconds), ("mse", 1.0)]));
            scene.add("prpf 16", values([("seconds", 100.0), ("mse", 100.0)]));
            scene.add(beside("prpf", 16), values([("seconds", seconds), ("mse", mse)]));
        }
        assert_eq!((scene.speed_up("prpf", 16).mean, scene.mse_over_rpf("prpf", 16).mean), (8.0, 4.0));
        let runs = [("prpf", 16), ("prpf", 32), ("rpf", 16)];
        let runs = runs.map(|(method, spp)| scene.compared_run(method, spp));
        assert_eq!(runs, ["beside rpf prpf 16", "prpf 32", "rpf 16"]);
        assert_eq!([8, 16].map(|spp| scene.rpf_mse(spp)), ["mse 64", "mse 0"]);
    }
}
