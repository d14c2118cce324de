//! The host of a render on the command line: progress bar, signals, checkpoints and images.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use rayon::prelude::*;

use super::command_line::command_line;
use super::terminal::print_error;
use super::viewers::{earlier_names, next_names};
use crate::filter::FilterResult;
use crate::output::ImageOutput;
use crate::preview::{PreviewHost, SavedImage};
use crate::progressive::{Checkpoint, Host, Progress, Settings};
use crate::render::SampleSink;
use crate::state::{Checkpoints, ImageMetadata, SampleFile};
use crate::stats::Store;

/// Steps of the progress bar.
const BAR_STEPS: u64 = 1000;

/// The host of a render.
pub(super) struct RenderHost<'a> {
    pub metadata: &'a ImageMetadata,
    pub outfiles: &'a [PathBuf],
    /// Names of the layers beside the image; `None` for all.
    pub layers: Option<&'a [String]>,
    pub checkpoints: Option<Checkpoints>,
    pub samples: Option<SampleFile>,
    /// Set by a signal.
    pub interrupt: &'a AtomicBool,
    /// Whether a controller asks for problems with checkpoints.
    pub has_viewers: bool,
    pub bar: ProgressBar,
    /// When the program started.
    pub start: Instant,
}

/// Returns a progress bar; a hidden one if the command is quiet.
pub(super) fn progress_bar(is_quiet: bool) -> ProgressBar {
    if is_quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{elapsed_precise} [{bar:32}] {percent:>3} %  {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(BAR_STEPS).with_style(style)
}

impl RenderHost<'_> {
    /// Returns an image with its metadata.
    fn output<'o>(
        &'o self,
        (result, side): (&'o FilterResult, usize),
        store: &'o Store,
        settings: &'o Settings,
        metadata: &'o ImageMetadata,
        command_line: &'o str,
    ) -> ImageOutput<'o> {
        ImageOutput {
            side,
            seconds: self.start.elapsed().as_secs_f64(),
            command_line,
            layers: self.layers,
            ..ImageOutput::interim(result, store, settings, metadata)
        }
    }
}

impl Host for RenderHost<'_> {
    fn listen(&mut self, progress: &Progress) {
        let error = progress.estimate.map(|e| format!("  relMSE {:.1e} to {:.1e}", e.low, e.high));
        let error = error.unwrap_or_default();
        let ending = if self.is_interrupted() { "  ending soon, Ctrl-C quits at once" } else { "" };
        let is_first = self.bar.position() == 0;
        self.bar.set_position((progress.fraction * BAR_STEPS as f64) as u64);
        if is_first {
            // Loading time and resumed samples do not count towards the rate
            self.bar.reset_eta();
        }
        // Without a budget that is reached at a known rate there is nothing to tell.
        let left = self.bar.eta();
        let to_go =
            if left.as_secs() > 0 { format!("  to go {:#}", HumanDuration(left)) } else { String::new() };
        self.bar.set_message(format!("{:.1} spp{error}{to_go}{ending}", progress.spp));
        if !self.has_viewers {
            self.checkpoint_problem();
        }
    }

    fn is_interrupted(&self) -> bool {
        self.interrupt.load(Ordering::Relaxed)
    }

    fn encode_and_discard(&self, settings: &Settings, result: &FilterResult, rows: &Store) {
        let output = self.output((result, 1), rows, settings, self.metadata, "");
        self.outfiles.par_iter().for_each(|path| output.encode_and_discard(path));
        self.checkpoints.iter().for_each(|checkpoints| checkpoints.write_and_discard(settings, rows));
    }

    fn checkpoint_interval(&self) -> Option<f64> {
        self.checkpoints.as_ref().map(Checkpoints::interval)
    }

    fn sample_sink(&mut self) -> Option<&mut dyn SampleSink> {
        self.samples.as_mut().map(|file| file as &mut dyn SampleSink)
    }

    fn save(&mut self, settings: &Settings, checkpoint: Checkpoint) {
        if let Some(checkpoints) = &self.checkpoints {
            checkpoints.save(settings, checkpoint);
        }
    }
}

impl PreviewHost for RenderHost<'_> {
    /// Writes EXR and PNG under the next free number.
    fn write_image(&mut self, image: &SavedImage) -> Result<Vec<PathBuf>, String> {
        let names = next_names(&self.outfiles[0]).ok_or("all numbers are taken")?;
        let command_line = command_line();
        let metadata = self.metadata.with_camera(image.camera);
        let output =
            self.output((image.result, image.side), image.store, image.settings, &metadata, &command_line);
        for name in &names {
            output.write(name).map_err(|error| error.to_string())?;
        }
        Ok(names.into())
    }

    fn earlier_images(&self) -> Vec<PathBuf> {
        earlier_names(&self.outfiles[0])
    }

    /// Also prints the problem.
    fn checkpoint_problem(&mut self) -> Option<String> {
        let problem = self.checkpoints.as_mut().and_then(Checkpoints::problem)?.to_string();
        print_error(&format!("warning: {problem}; the render goes on"));
        Some(problem)
    }

    fn wait_for_checkpoint(&mut self) -> Result<(), String> {
        let waited = self.checkpoints.as_ref().map_or(Ok(()), Checkpoints::wait);
        waited.map_err(|error| error.to_string())
    }
}
