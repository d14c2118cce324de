//! The command line: arguments → settings → loop → report.
//!
//! Exit status: 0 done; 1 the render failed (or an image is farther from its reference than asked);
//! 2 the command line or an input file is wrong; 130 interrupted by SIGINT, SIGTERM or SIGHUP, image and state written
//! (a preview that is closed has nothing to write, and is done: 0).

mod allocate;
mod allocator;
mod checkpoints;
mod command_line;
mod compare;
mod debug_sample;
mod denoise;
mod denoise_images;
mod denoiser_options;
mod export;
mod failure;
mod host;
mod info;
mod inputs;
mod job;
mod merge;
mod mode;
mod options;
mod parse;
mod preview;
mod processes;
mod program;
mod render;
mod sample_map;
mod samples;
mod scene_changes;
mod scene_files;
mod signals;
mod state_options;
mod summary;
mod terminal;
mod usage;
mod viewers;
mod workers;

pub use allocator::Allocator;
pub use program::run;
