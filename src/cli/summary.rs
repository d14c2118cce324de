//! The last lines that `prpf render` prints.

use std::path::PathBuf;

use super::escaped;
use super::report::{Spread, Times};
use crate::progressive::{ErrorEstimate, Hurried, Outcome};
use crate::stats::{LARGEST_VALUE, Part, Store};

/// What the command prints at its end: times, samples, the estimate and where the images are.
pub(super) fn of(outcome: &Outcome, seconds: Times, outfiles: &[PathBuf], verbose: bool) -> String {
    let mut lines = Vec::new();
    let spread = Spread::of(&outcome.store);
    if verbose {
        for batch in &outcome.batches {
            lines.push(format!(
                "batch {:>2}  {:>8.2} s  {:>12} samples  filter {:>6.3} s  error {}",
                batch.index,
                batch.seconds,
                batch.samples_total,
                batch.filter_seconds,
                batch.relmse.or(batch.estimated_error).map_or("-".to_owned(), |e| format!("{e:.3e}")),
            ));
        }
    }
    lines.push(format!(
        "{:.2} s (load {:.2}, build {:.2}, render {:.2}, filter {:.2}, allocate {:.2}, write {:.2}), \
         {:.1} samples per pixel ({} to {}), {:.2} M samples/s",
        seconds.total,
        seconds.load,
        seconds.build,
        seconds.render,
        seconds.filter,
        seconds.allocate,
        seconds.write,
        spread.mean,
        spread.min,
        spread.max,
        outcome.own_samples as f64 / seconds.render.max(1e-9) / 1e6,
    ));
    if let Some(hurried) = outcome.hurried {
        let what = match hurried {
            Hurried::Draft => "this is `--quality draft`",
            Hurried::Unfiltered => "this is unfiltered",
        };
        lines.push(format!("the time was too short for the filter that was asked for: {what}"));
    }
    if outcome.store.drawn() < outcome.store.pixels() as u64 {
        let without = outcome.store.counts(Part::Whole).iter().filter(|&&n| n == 0).count();
        lines.push(format!(
            "the time was too short for one sample per pixel: {:.0} % of the pixels have none, and show what is \
             beside them",
            100.0 * without as f64 / outcome.store.pixels().max(1) as f64
        ));
    }
    let rejected = outcome.store.rejected();
    if rejected > 0 {
        lines.push(format!(
            "{rejected} samples were rejected: their radiance was not finite, negative, or beyond {LARGEST_VALUE:e}"
        ));
    }
    let error = outcome.estimate.as_ref().map(|e| said(e, &outcome.store)).unwrap_or_default();
    lines.push(format!("{error}stopped by {}", outcome.stopped_by));
    let shown = outcome.estimate.as_ref().is_some_and(|estimate| !estimate.is_hidden());
    if let Some(forecast) = outcome.forecast().filter(|_| shown) {
        lines.push(format!(
            "half of that error would take about {:.0} s more (it falls as time to the power -{:.1})",
            forecast.halving_seconds.ceil(),
            forecast.power
        ));
    }
    for path in outfiles {
        lines.push(escaped(&path.to_string_lossy()));
    }
    lines.push(String::new());
    lines.join("\n")
}

/// The estimate, and the image that it is of.
fn said(estimate: &ErrorEstimate, store: &Store) -> String {
    let spp = estimate.samples as f64 / store.pixels().max(1) as f64;
    if estimate.is_hidden() {
        return format!("estimated relMSE below {:.0e} at {spp:.1} samples per pixel, ", estimate.at_most());
    }
    format!(
        "estimated relMSE {:.1e} ± {:.0e} at {spp:.1} samples per pixel, ",
        estimate.image, estimate.standard_error
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Planes;
    use crate::stats::Layout;

    #[test]
    fn an_error_hidden_by_noise_is_said_to_be_below_a_limit() {
        let store = Store::new(10, 10, Layout::with_blocks(|_| false), 0, 0);
        let of = |image, standard_error| {
            said(&ErrorEstimate { image, standard_error, samples: 800, tiles: Planes::new(1, 1, 1) }, &store)
        };
        assert_eq!(of(4e-3, 1e-3), "estimated relMSE 4.0e-3 ± 1e-3 at 8.0 samples per pixel, ");
        assert_eq!(of(1e-3, 2e-3), "estimated relMSE below 3e-3 at 8.0 samples per pixel, ");
        assert_eq!(of(-1e-3, 2e-3), "estimated relMSE below 2e-3 at 8.0 samples per pixel, ");
    }
}
