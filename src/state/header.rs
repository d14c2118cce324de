//! The header of a state file: everything but the arrays, as JSON that people and scripts can read.

use serde::{Deserialize, Serialize};

use super::image_metadata::ImageMetadata;
use super::render_state::RenderState;
use super::stream::Stream;
use crate::filter::DenoiserName;
use crate::progressive::{Checkpoint, Grain, PassRecord, Position, Settings, Speed};

/// A state without its arrays; their presence and sizes follow from it.
#[derive(Serialize, Deserialize)]
pub struct Header {
    /// Version of the program that wrote it.
    pub program: String,
    pub metadata: ImageMetadata,
    pub settings: Settings,
    /// Missing where an earlier program has written the state.
    #[serde(default)]
    pub weights: Option<String>,
    pub streams: Vec<Stream>,
    /// Names of the sample vector's dimensions.
    pub dimensions: Vec<String>,
    /// Names of the dimensions that the scene calls for and the render did not keep.
    pub left_out: Vec<String>,
    /// Sample vectors per pixel that the reservoir holds at most.
    pub capacity: usize,
    pub position: PositionHeader,
    pub passes: Vec<PassRecord>,
    pub speed: Speed,
    pub interim: Option<InterimHeader>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PositionHeader {
    Plan,
    Render { done: f64, grain: Grain },
    Filter,
}

#[derive(Serialize, Deserialize)]
pub struct EstimateHeader {
    pub value: f64,
    pub deviation: f64,
    /// 0 where an earlier program has written the state.
    #[serde(default)]
    pub unfiltered: f64,
    pub samples: u64,
}

#[derive(Serialize, Deserialize)]
pub struct InterimHeader {
    pub made_by: DenoiserName,
    /// With a map of interpolation failures.
    pub interpolation_success: Option<f32>,
    pub estimate: Option<EstimateHeader>,
}

impl Header {
    /// Describes a state.
    pub fn new(state: &RenderState) -> Self {
        let Checkpoint { store, position, passes, interim, speed } = &state.checkpoint;
        Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            metadata: state.metadata.clone(),
            settings: state.settings.clone(),
            weights: state.weights.clone(),
            streams: state.streams.clone(),
            dimensions: store.layout().dimensions().iter().map(|d| d.name.to_owned()).collect(),
            left_out: store.layout().names_left_out(|_| true).into_iter().map(str::to_owned).collect(),
            capacity: store.capacity(),
            position: match position {
                Position::Plan => PositionHeader::Plan,
                Position::Render(batch) => PositionHeader::Render { done: batch.done, grain: batch.grain },
                Position::Filter => PositionHeader::Filter,
            },
            passes: passes.clone(),
            speed: *speed,
            interim: interim.as_ref().map(|interim| InterimHeader {
                made_by: interim.made_by,
                interpolation_success: interim.interpolation.as_ref().map(|found| found.success),
                estimate: interim.estimate.as_ref().map(|estimate| EstimateHeader {
                    value: estimate.value,
                    deviation: estimate.deviation,
                    unfiltered: estimate.unfiltered,
                    samples: estimate.samples,
                }),
            }),
        }
    }
}
