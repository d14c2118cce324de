//! What a director is given: the scene, how to render it, and what to do with its images.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use crate::filter::{Filtered, Quality};
use crate::image::Planes;
use crate::progressive::{Closing, Denoiser, Keep, Memory, Progress, Settings};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stats::Store;

/// An image to be written.
pub struct Picture<'a> {
    pub store: &'a Store,
    pub filtered: &'a Filtered,
    pub made_by: (Denoiser, Quality),
    pub settings: &'a Settings,
}

/// Writes a picture; says where, or in one line why not.
pub type Save<'a> = Box<dyn FnMut(&Picture) -> Result<Vec<PathBuf>, String> + 'a>;

/// How memories of a render are kept.
#[derive(Clone, Copy)]
pub struct Keeping<'a> {
    /// Seconds from one to the next.
    pub every: f64,
    pub keep: Keep<'a>,
    /// Tells in one line what went wrong since it was last asked.
    pub news: &'a dyn Fn() -> Option<String>,
    /// Waits for what is being kept; the newest may not be.
    pub settle: &'a dyn Fn() -> Result<(), String>,
}

/// What a render is directed by from the start.
pub struct Stage<'a> {
    pub scene: &'a Scene,
    /// Of the scene's own camera.
    pub renderer: &'a Renderer<'a>,
    pub settings: Settings,
    pub reference: Option<&'a Planes>,
    /// What is done with the image at the end, for the loop to rehearse.
    pub closing: Option<Closing<'a>>,
    /// Until the render begins anew: the samples of another view would not be the scene's, and fewer must not
    /// replace more.
    pub keeping: Option<Keeping<'a>>,
    /// What the first view goes on from.
    pub resumed: Option<Memory>,
    /// When the program started.
    pub start: Instant,
    pub interrupt: &'a AtomicBool,
    /// Stay when a budget is spent, until interrupted; else end there.
    pub stays: bool,
    pub save: Save<'a>,
    /// Hears of every step.
    pub listen: Box<dyn FnMut(Progress) + 'a>,
}
