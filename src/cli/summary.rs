//! The summary that `prpf render` prints at its end.

use std::path::PathBuf;

use super::terminal::escaped;
use crate::output::{SampleCounts, Times};
use crate::progressive::{ErrorEstimate, Outcome, PassRecord, excessive_ratio};
use crate::render::RejectedSample;
use crate::stats::{LARGEST_VALUE, Part};

/// Returns the summary: times, samples, the estimated error, and the paths of the images.
pub(super) fn summary(outcome: &Outcome, seconds: Times, outfiles: &[PathBuf], is_verbose: bool) -> String {
    let mut lines = Vec::new();
    if is_verbose {
        lines.extend(passes(outcome));
    }
    lines.push(times_and_samples(outcome, seconds));
    lines.extend(shortcomings(outcome));

    // The error
    let error = outcome.estimate.as_ref().map_or("no estimate of the error".to_owned(), describe);
    lines.push(format!("{error}, stopped by {}", outcome.stopped_by));
    if let Some(forecast) = outcome.forecast() {
        lines.push(format!(
            "halving that error would take about {:.0} s more (it falls as time to the power -{:.1})",
            forecast.halving_seconds.ceil(),
            forecast.power
        ));
    }

    lines.extend(outfiles.iter().map(|path| escaped(&path.to_string_lossy())));
    lines.push(String::new());
    lines.join("\n")
}

/// Returns a line for each filter pass.
fn passes(outcome: &Outcome) -> Vec<String> {
    let line = |pass: &PassRecord| {
        let error = pass.relmse.or(pass.estimated_error).map_or("-".to_owned(), |e| format!("{e:.3e}"));
        format!(
            "batch {:>2}  {:>8.2} s  {:>12} samples  filter {:>6.3} s  error {error}",
            pass.index, pass.seconds, pass.samples_total, pass.filter_seconds
        )
    };
    outcome.passes.iter().map(line).collect()
}

fn times_and_samples(outcome: &Outcome, seconds: Times) -> String {
    let counts = SampleCounts::new(&outcome.store);
    let Times { load, build, render, filter, calibrate, allocate, write, total } = seconds;
    format!(
        "{total:.2} s (load {load:.2}, build {build:.2}, render {render:.2}, filter {filter:.2}, calibrate \
         {calibrate:.2}, allocate {allocate:.2}, write {write:.2}), {:.1} samples per pixel ({} to {}), {:.2} M samples/s",
        counts.mean,
        counts.min,
        counts.max,
        outcome.own_samples as f64 / render.max(1e-9) / 1e6,
    )
}

/// Returns a line for each way in which the image is less than was asked for.
fn shortcomings(outcome: &Outcome) -> Vec<String> {
    let mut lines = Vec::new();
    let store = &outcome.store;
    if outcome.is_fallback() {
        let denoiser = outcome.settings.denoiser.name();
        let reason = outcome
            .result
            .failure
            .clone()
            .unwrap_or_else(|| format!("too little time or too few samples for the denoiser {denoiser}"));
        lines.push(format!("{reason}: the image was made by {}", outcome.result.made_by));
    }
    if outcome.side > 1 {
        lines.push(format!(
            "too little time or too few samples for pixels: squares of {0}×{0} were filtered",
            outcome.side
        ));
    }
    let is_sparse = store.samples_taken() < store.pixels() as u64;
    let empty = store.counts(Part::Whole).iter().filter(|&&n| n == 0).count();
    if empty > 0 && (is_sparse || outcome.settings.sample_map.is_some()) {
        lines.push(format!(
            "{}{:.0} % of the pixels have none, and get the light of those around them",
            if is_sparse {
                "there is less than one sample per pixel: "
            } else {
                "the sample map leaves pixels without samples: "
            },
            100.0 * empty as f64 / store.pixels().max(1) as f64
        ));
    }
    if store.rejected() > 0 {
        lines.push(format!(
            "{} samples were rejected: their radiance was not finite, negative, or beyond {LARGEST_VALUE:e}{}",
            store.rejected(),
            outcome.first_rejected.map_or_else(String::new, |RejectedSample { x, y, index }| format!(
                "; --debug-sample {x},{y},{index} prints the path of the first"
            ))
        ));
    }
    if let Some(ratio) = excessive_ratio(&outcome.passes, &outcome.settings) {
        lines.push(format!(
            "sampled uniformly: adaptive sampling was predicted to leave {ratio:.2} of uniform sampling's error, too small a \
             gain for the time it takes"
        ));
    }
    lines
}

/// Describes an estimate and its interval.
pub(super) fn describe(estimate: &ErrorEstimate) -> String {
    let [low, high] = estimate.interval();
    format!("estimated relMSE {:.1e} ({low:.1e} to {high:.1e})", estimate.value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Planes;

    #[test]
    fn an_error_is_given_with_its_interval() {
        let tiles = Planes::new(1, 1, 1);
        let estimate = ErrorEstimate { value: 4e-3, deviation: 0.25, unfiltered: 0.1, samples: 800, tiles };
        assert_eq!(describe(&estimate), "estimated relMSE 4.0e-3 (2.5e-3 to 6.5e-3)");
    }
}
