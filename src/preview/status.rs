//! What everyone who looks is told: where the render stands, what it follows, what it costs.

use std::collections::VecDeque;

use serde::Serialize;

use super::view::Scale;
use crate::progressive::{Estimated, Forecast, Point, Settings};

/// Where the render is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    Rendering,
    Filtering,
    Paused,
    Finished,
}

/// Sent as JSON whenever something of it changes, a few times a second at most.
#[derive(Serialize)]
pub struct Status<'a> {
    /// Tells it from answers.
    pub r#type: &'static str,
    pub scene: &'a str,
    pub width: usize,
    pub height: usize,
    pub generation: u32,
    pub phase: Phase,
    /// What ended a finished render.
    pub stopped_by: Option<crate::progressive::StoppedBy>,
    pub settings: &'a Settings,
    pub views: &'a [Described],
    pub statistics: Statistics,
    /// Estimated error against time.
    pub curve: &'a [Point],
    pub forecast: Option<Forecast>,
    pub camera: Lens,
    /// Shares of width and height that get samples first.
    pub region: Option<[[f32; 2]; 2]>,
    /// The latest ones, newest last.
    pub notices: &'a VecDeque<Notice>,
}

/// A view that this render has.
#[derive(Clone, Copy, Serialize)]
pub struct Described {
    pub view: super::view::View,
    pub scale: Option<Scale>,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Statistics {
    pub seconds: f64,
    /// Share of the nearest budget that is spent.
    pub fraction: f64,
    pub samples: u64,
    pub mean: f64,
    pub min: u32,
    pub max: u32,
    pub samples_per_second: f64,
    pub filter_share: f64,
    pub memory_bytes: Option<u64>,
    pub estimate: Option<Estimated>,
}

/// What can be steered of the camera beside its place, in scene units.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Lens {
    pub aperture: f32,
    pub focus: f32,
    /// To the point looked at.
    pub distance: f64,
}

/// Something that a person should know, such as where an image was saved.
#[derive(Clone, Debug, Serialize)]
pub struct Notice {
    /// Counts notices, from one.
    pub number: u32,
    pub text: String,
    pub is_problem: bool,
}
