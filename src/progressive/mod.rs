//! The render loop: render a batch into the store, filter, decide where the next batch goes, until a budget is spent.
//!
//! It is plain state. A [`Checkpoint`] is the complete state of a render. [`next_action`] is a pure
//! function: it takes a [`Situation`] (settings, where the checkpoint stands, what was measured, the time) and returns an
//! [`Action`]. [`RenderLoop`] performs actions. Two drivers ask for one action after the other: [`run`] blocks, as the
//! command line needs it, and the preview's controller listens to its viewers between two. Below this room nothing reads
//! a clock but `memory::prepare`, which measures what new memory costs.
//!
//! | file | holds |
//! | --- | --- |
//! | `action`, `situation` | the decisions |
//! | `last_pass` | the choice of the last filter pass, another one where time or samples are short |
//! | `schedule`, `budget`, `speed` | sizes of batches and steps, and their limits |
//! | `finalisation`, `calibration` | the predicted and the measured time of the last pass and the outputs |
//! | `time_constants` | every constant of time keeping |
//! | `checkpoint`, `record`, `stopped_by` | the state of a render, and its outcome |
//! | `render_loop` | the actions |
//! | `allocation`, `region_batch`, `steps`, `filter_pass`, `error_estimate`, `excerpt` | their parts |
//! | `blocking`, `host` | the driver of the command line, and its interface to the program around it |
//! | `process_group` | the loop's interface to processes that render one image together |
//! | `settings`, `default_denoiser`, `memory_budget`, `store_size` | the settings, and the memory they need |
//! | `forecast`, `clock` | the expected fall of the error; seconds since the program's start |

mod action;
mod allocation;
mod blocking;
mod budget;
mod calibration;
mod checkpoint;
mod clock;
mod default_denoiser;
mod error_estimate;
mod excerpt;
mod filter_pass;
mod finalisation;
mod forecast;
mod host;
mod last_pass;
mod memory_budget;
mod process_group;
mod record;
mod region_batch;
mod render_loop;
mod schedule;
mod settings;
mod situation;
mod speed;
mod steps;
mod stopped_by;
mod store_size;
mod time_constants;

pub use action::{Action, next_action};
pub use allocation::allocate_after;
pub use blocking::run;
pub use budget::Budget;
pub use checkpoint::{Checkpoint, InterimPass, Position, SampleBatch};
pub use default_denoiser::default_denoiser;
pub use error_estimate::{ErrorEstimate, EstimateSummary, HalfImages, TILE};
pub use filter_pass::{FailureMap, FilterPass, Filtered};
pub use forecast::{Forecast, Point, forecast};
pub use host::Host;
pub use memory_budget::{MemoryError, fits_in_memory, memory_needed};
pub use process_group::{ProcessGroup, ProcessRecord, Rendered, SampleTotals};
pub use record::{Outcome, PassRecord, Progress, Seconds, excessive_ratio};
pub use render_loop::RenderLoop;
pub use schedule::Plan;
pub use settings::{MIN_SPP, PixelMemory, RecordedStatistics, Settings, SettingsError};
pub use situation::{Conditions, Mark, Measurements, Situation};
pub use speed::Speed;
pub use steps::Grain;
pub use stopped_by::StoppedBy;
pub use store_size::{StoreSizeError, check_store_size};
