//! The record of a render: its filter passes, its progress, and its outcome.

use super::error_estimate::{ErrorEstimate, EstimateSummary};
use super::filter_pass::Filtered;
use super::forecast::{Forecast, Point, forecast};
use super::process_group::ProcessRecord;
use super::settings::Settings;
use super::stopped_by::StoppedBy;
use crate::filter::FilterResult;
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::render::RejectedSample;
use crate::stats::{Part, Store};

/// Returns the expected ratio of the errors of adaptive and uniform sampling if it is too large for adaptive sampling to be
/// worth its time. The first pass that has one decides.
pub fn excessive_ratio(passes: &[PassRecord], settings: &Settings) -> Option<f64> {
    let expected_ratio = passes.iter().find_map(|pass| pass.expected_ratio);
    expected_ratio.filter(|&ratio| ratio > f64::from(settings.priority.max_ratio))
}

/// A filter pass of the loop.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PassRecord {
    pub index: usize,
    /// Seconds from the program's start to the pass's end, time on hold excluded.
    pub seconds: f64,
    pub samples_total: u64,
    pub filter_seconds: f64,
    /// Fraction of the pixels between grid nodes whose weights were interpolated.
    pub interpolation_success: Option<f32>,
    /// The expected ratio of the errors of adaptive and uniform sampling, of the first pass that is asked for it. It decides
    /// how the other samples are placed (see [`PrioritySettings`](crate::adaptive::PrioritySettings)).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected_ratio: Option<f64>,
    /// Estimates of the relMSE of its image, and of the unfiltered one.
    pub estimated_error: Option<f64>,
    pub estimated_unfiltered_error: Option<f64>,
    /// True errors of the filtered image and of the unfiltered mean, with a reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relmse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noisy_mse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noisy_relmse: Option<f64>,
}

impl PassRecord {
    /// Records a pass over a store, with the true errors if there is a reference. When it was made is left open.
    pub(super) fn new(filtered: &Filtered, reference: Option<&Planes>, store: &Store) -> Self {
        let Filtered { result, estimate, seconds, .. } = filtered;
        let noisy = reference.map(|_| store.means(Part::Whole, store.layout().radiance()));
        let compare = |image: Option<&Planes>, metric: fn(&Pair) -> f64| {
            let pair = image.zip(reference);
            pair.and_then(|(image, reference)| Some(metric(&Pair::new(image, reference).ok()?)))
        };
        Self {
            filter_seconds: *seconds,
            interpolation_success: result.interpolation.as_ref().map(|found| found.success),
            estimated_error: estimate.as_ref().map(|estimate| estimate.value),
            estimated_unfiltered_error: estimate.as_ref().map(|estimate| estimate.unfiltered),
            mse: compare(Some(&result.image), |pair| pair.mse()),
            relmse: compare(Some(&result.image), |pair| pair.relmse()),
            noisy_mse: compare(noisy.as_ref(), |pair| pair.mse()),
            noisy_relmse: compare(noisy.as_ref(), |pair| pair.relmse()),
            ..Self::default()
        }
    }

    /// Returns the pass as a point of the curve of the error, if its error is known.
    pub(super) fn point(&self, seconds_per_sample: f64) -> Option<Point> {
        Some(Point {
            seconds: self.samples_total as f64 * seconds_per_sample,
            error: self.estimated_error?,
            unfiltered_error: self.estimated_unfiltered_error?,
        })
    }
}

/// Seconds of the loop's stages.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    pub render: f64,
    /// Of filter passes.
    pub filter: f64,
    /// Of the calibration of the last pass under a time budget, which prepares its memory.
    pub calibrate: f64,
    pub allocate: f64,
}

/// A finished render.
pub struct Outcome {
    /// The image. Its interpolation is that of the last interim pass if its denoiser does not interpolate.
    pub result: FilterResult,
    /// Side of the squares that were filtered for it, in pixels; 1 if pixels were.
    pub side: usize,
    pub store: Store,
    /// Samples of the store that this run took: all, unless it resumed a checkpoint.
    pub own_samples: u64,
    pub passes: Vec<PassRecord>,
    pub stopped_by: StoppedBy,
    pub seconds: Seconds,
    /// The first sample of this run that the store has rejected.
    pub first_rejected: Option<RejectedSample>,
    /// The estimate of the image's relMSE.
    pub estimate: Option<ErrorEstimate>,
    /// The settings at the end: a user may have changed them on the way.
    pub settings: Settings,
    /// What each of several processes has done; empty if there was one.
    pub processes: Vec<ProcessRecord>,
}

impl Outcome {
    /// Returns whether another denoiser than the one asked for has made the image, because time or samples were few.
    pub fn is_fallback(&self) -> bool {
        self.result.made_by != self.settings.denoiser.name()
    }

    /// Returns how the error of the final image is expected to fall, from its gain and from the estimates of the interim images, if
    /// there are any; `halving_seconds` counts from the final image. Another denoiser may have made that one, so that it
    /// is no point of the same curve. Time is taken as proportional to samples, so that an interruption or a change of speed
    /// does not count. Neither do filter passes: the last one is made in place of another, and those before it are few.
    pub fn forecast(&self) -> Option<Forecast> {
        let Seconds { render, allocate, .. } = self.seconds;
        let seconds_per_sample =
            (self.own_samples > 0).then(|| (render + allocate) / self.own_samples as f64)?;
        let (last, interim) = self.passes.split_last()?;
        let has_estimates = interim.iter().any(|pass| pass.estimated_error.is_some());
        let passes = if has_estimates { interim } else { std::slice::from_ref(last) };
        let points: Vec<Point> = passes.iter().filter_map(|pass| pass.point(seconds_per_sample)).collect();
        let latest = last.point(seconds_per_sample).or(points.last().copied())?;
        let found = forecast(&points, &latest)?;
        Some(Forecast {
            halving_seconds: found.halving_after(seconds_per_sample * self.store.samples() as f64),
            ..found
        })
    }
}

/// How far a render has come, after a step.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Fraction of the nearest budget that is spent, in [0, 1].
    pub fraction: f64,
    /// Seconds since the start, time on hold excluded.
    pub elapsed: f64,
    /// Samples in the store.
    pub samples: u64,
    /// The same per pixel.
    pub spp: f64,
    pub estimate: Option<EstimateSummary>,
}
