//! What the loop tells of itself: while it runs, and when it is done.

use super::estimate::Estimated;
use super::{Denoiser, ErrorEstimate, Forecast, Point, Settings, forecast};
use crate::filter::{Filtered, Quality};
use crate::stats::Store;

/// A filter pass of the loop and what was rendered before it.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Batch {
    pub index: usize,
    /// Since the program's start, time that a person had it stand still left out, when the pass's image stood.
    pub seconds: f64,
    pub samples_total: u64,
    pub filter_seconds: f64,
    pub interpolation_success: Option<f32>,
    /// Latest estimate of the relative MSE, of an image shown *before* this batch.
    pub estimated_error: Option<f64>,
    /// Samples that that image was made of.
    pub estimated_error_samples: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relmse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noisy_mse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noisy_relmse: Option<f64>,
}

/// What ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StoppedBy {
    Spp,
    Time,
    TargetError,
    Interrupt,
}

impl std::fmt::Display for StoppedBy {
    /// As in the report.
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::Spp => "spp",
            Self::Time => "time",
            Self::TargetError => "target-error",
            Self::Interrupt => "interrupt",
        })
    }
}

/// A last pass that is quicker than what was asked for, the quickest last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hurried {
    /// That of [`Quality::Draft`](crate::filter::Quality::Draft).
    Draft,
    Unfiltered,
}

/// Where the time went, in seconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    pub render: f64,
    pub filter: f64,
    pub allocate: f64,
}

/// A finished render.
pub struct Outcome {
    /// The image. Its interpolation failures are those of the last rerun where the filter itself does
    /// not interpolate.
    pub filtered: Filtered,
    pub store: Store,
    /// Samples of the store that this run made; all, unless it went on from a state.
    pub own_samples: u64,
    pub batches: Vec<Batch>,
    pub stopped_by: StoppedBy,
    pub seconds: Seconds,
    /// The latest estimate of the image's relMSE; of an image with fewer samples than the final one.
    pub estimate: Option<ErrorEstimate>,
    /// The last pass.
    pub last_filter: (Denoiser, Quality),
    /// What it was, if the time did not suffice for the filter that was asked for.
    pub hurried: Option<Hurried>,
    /// What was followed at the end: a person may have changed it on the way.
    pub settings: Settings,
}

impl Outcome {
    /// How the error is expected to go on, from the estimates on the way; `halving_seconds` counts from the
    /// final image. Time is taken to go with samples, so that what an interruption or a change of pace cost
    /// is shared by all.
    pub fn forecast(&self) -> Option<Forecast> {
        let spent = self.seconds.render + self.seconds.filter + self.seconds.allocate;
        let of_sample = (self.own_samples > 0).then(|| spent / self.own_samples as f64)?;
        let mut points: Vec<Point> = Vec::new();
        for batch in &self.batches {
            if let (Some(error), Some(samples)) = (batch.estimated_error, batch.estimated_error_samples) {
                let seconds = samples as f64 * of_sample;
                if points.last().is_none_or(|last| last.seconds < seconds) {
                    points.push(Point { seconds, error });
                }
            }
        }
        let found = forecast(&points)?;
        Some(Forecast {
            halving_seconds: found.halving_after(of_sample * self.store.samples() as f64),
            ..found
        })
    }
}

/// A sign of life, after every step of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Share of the nearest budget that is spent, in [0, 1].
    pub fraction: f64,
    /// Seconds since the start, those not counted in which the render was held.
    pub elapsed: f64,
    pub samples: u64,
    pub spp: f64,
    pub estimate: Option<Estimated>,
}

/// How [`super::Loop::advance`] ended.
pub enum Ended {
    /// A budget is spent; the last filter pass.
    Finished(Box<Filtered>, StoppedBy),
    /// The observer wanted to leave.
    Left,
}
