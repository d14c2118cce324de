//! The header of a state file: everything but the arrays, as JSON that people and scripts can read.

use serde::{Deserialize, Serialize};

use super::image_metadata::ImageMetadata;
use super::render_state::RenderState;
use super::stream::Stream;
use crate::progressive::{Batch, Grain, Memory, Settings};

/// A state without its arrays; their presence and sizes follow from it.
#[derive(Serialize, Deserialize)]
pub struct Header {
    /// Version of the program that wrote it.
    pub program: String,
    pub metadata: ImageMetadata,
    pub settings: Settings,
    pub streams: Vec<Stream>,
    /// Names of the sample vector's dimensions.
    pub dimensions: Vec<String>,
    /// Sample vectors per pixel that the reservoir holds at most.
    pub capacity: usize,
    pub batches: Vec<Batch>,
    pub recent: (f64, f64),
    pub estimate: Option<EstimateHeader>,
    pub rerun: Option<RerunHeader>,
    pub under_way: Option<UnderWayHeader>,
}

#[derive(Serialize, Deserialize)]
pub struct EstimateHeader {
    pub image: f64,
    pub standard_error: f64,
    pub samples: u64,
}

#[derive(Serialize, Deserialize)]
pub struct RerunHeader {
    /// Whether a map of interpolation failures follows.
    pub failure: bool,
    pub success: Option<f32>,
}

#[derive(Serialize, Deserialize)]
pub struct UnderWayHeader {
    pub done: f64,
    pub grain: Grain,
}

impl Header {
    /// Describes a state.
    pub fn new(state: &RenderState) -> Self {
        let Memory { store, batches, estimate, rerun, under_way, recent } = &state.memory;
        Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            metadata: state.metadata.clone(),
            settings: state.settings.clone(),
            streams: state.streams.clone(),
            dimensions: store.layout().dimensions().iter().map(|d| d.name.to_owned()).collect(),
            capacity: store.capacity(),
            batches: batches.clone(),
            recent: *recent,
            estimate: estimate.as_ref().map(|e| EstimateHeader {
                image: e.image,
                standard_error: e.standard_error,
                samples: e.samples,
            }),
            rerun: rerun.as_ref().map(|r| RerunHeader { failure: r.failure.is_some(), success: r.success }),
            under_way: under_way.as_ref().map(|u| UnderWayHeader { done: u.done, grain: u.grain }),
        }
    }
}
