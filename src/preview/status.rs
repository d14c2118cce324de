//! The status of a render, as the page shows it: phase, settings, statistics, error curve, notices.

use serde::Serialize;

use super::colour_scale::ColourScale;
use super::command::Rectangle;
use super::notices::Notice;
use super::saved_images::ListedFile;
use super::view::View;
use crate::filter::DenoiserName;
use crate::progressive::{EstimateSummary, Point, Settings};

/// What the render is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    Rendering,
    Filtering,
    Paused,
    Finished,
}

/// The message that all viewers get, as JSON, a few times a second at most.
#[derive(Serialize)]
pub struct Status<'a> {
    /// Tells the message from others.
    pub r#type: &'static str,
    pub scene: &'a str,
    pub width: usize,
    pub height: usize,
    pub generation: u32,
    pub phase: Phase,
    /// Whether the render is paused, also while a filter pass runs.
    pub is_paused: bool,
    /// The limit that ended a finished render, also while a filter pass runs.
    pub stopped_by: Option<crate::progressive::StoppedBy>,
    pub settings: &'a Settings,
    /// All denoisers, for the page to choose from.
    pub denoisers: &'a [DenoiserInfo],
    pub most_spp_kept: MostSpp,
    pub history: &'a HistoryStatus,
    /// The denoiser that made the image that is shown.
    pub made_by: Option<DenoiserName>,
    pub views: &'a [ViewInfo],
    pub statistics: RenderProgress,
    /// Estimated error over time.
    pub curve: Vec<Point>,
    pub forecast: Option<Expectation>,
    pub camera: &'a CameraStatus,
    pub bookmarks: &'a [ListedBookmark],
    /// Images to compare with, newest first.
    pub saves: Vec<ListedFile>,
    /// The region that is rendered first.
    pub region: Option<Rectangle>,
    /// The latest notices, newest last.
    pub notices: Vec<Notice>,
}

/// A denoiser that the page offers, and what choosing it costs.
#[derive(Clone, Copy, Serialize)]
pub struct DenoiserInfo {
    #[serde(flatten)]
    pub name: DenoiserName,
    pub summary: &'static str,
    /// Whether it needs sample vectors that the store does not keep, so that the render begins anew.
    pub begins_anew: bool,
    /// Memory of a render with it; `None` if it has no bound.
    pub memory_bytes: Option<f64>,
}

/// The largest budgets in samples per pixel with which the render goes on, by sampling; `None` where it does with any. A denoiser
/// that needs every sample vector begins anew with a larger one.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MostSpp {
    pub uniform: Option<u32>,
    pub adaptive: Option<u32>,
}

/// The renders to which a user can return.
#[derive(Clone, Debug, Default, Serialize)]
pub struct HistoryStatus {
    /// Descriptions of the renders to which undo and redo lead.
    pub undo: Option<String>,
    pub redo: Option<String>,
    /// Whether the current render can be kept beside another one.
    pub has_room: bool,
}

/// A view that this render has; maps have a colour scale.
#[derive(Clone, Copy, Serialize)]
pub struct ViewInfo {
    pub view: View,
    pub scale: Option<ColourScale>,
}

/// A camera to return to.
#[derive(Clone, Debug, Serialize)]
pub struct ListedBookmark {
    pub number: usize,
    /// The camera as directives of a scene file.
    pub directives: String,
}

/// What was sampled so far.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct RenderProgress {
    pub seconds: f64,
    /// Fraction of the budget that is nearest to its end.
    pub fraction: f64,
    pub samples: u64,
    /// Samples per pixel.
    pub mean: f64,
    pub min: u32,
    pub max: u32,
    pub samples_per_second: f64,
    /// Fraction of the time that filter passes took.
    pub filter_fraction: f64,
    pub memory_bytes: Option<u64>,
    pub estimate: Option<EstimateSummary>,
    /// relMSE and mean ꟻLIP of the filtered image with respect to the reference, if there is one.
    pub true_error: Option<f64>,
    pub flip: Option<f64>,
}

/// How the error is expected to fall from the latest point of the curve.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Expectation {
    /// The point of the curve at which the error is halved.
    pub halved: Point,
    /// Seconds of rendering from now until then; 0 if it should be halved by now.
    pub halving_seconds: f64,
    /// The same of the target, if there is one.
    pub target: Option<Point>,
    pub target_seconds: Option<f64>,
}

/// The camera: its lens and its distance to the pivot, in scene units, and all of it in writing.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CameraStatus {
    /// Radius of the lens.
    pub aperture: f32,
    /// Focal distance.
    pub focus: f32,
    /// Distance to the pivot.
    pub distance: f64,
    /// The camera as directives of a scene file.
    pub directives: String,
}
