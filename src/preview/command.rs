//! Commands from the page to the render thread.

use tokio::sync::mpsc;

use super::camera_move::CameraMove;
use super::history::HistoryStep;
use super::settings_change::SettingsChange;

/// A rectangle of the image: x and y ranges as fractions of its width and height, half open.
pub type Rectangle = [[f32; 2]; 2];

/// A command to the render.
#[derive(Clone, Debug)]
pub enum Command {
    /// A viewer is ready for an image: wakes an idle render.
    Wake,
    /// Pauses the render or resumes it.
    Pause(bool),
    ChangeSettings(SettingsChange),
    MoveCamera(CameraMove),
    /// Keeps the camera as a bookmark.
    AddBookmark,
    /// Removes the bookmark with this number.
    RemoveBookmark(usize),
    /// Renders this region first; `None` ends that.
    SetRegion(Option<Rectangle>),
    /// Discards all samples.
    Restart,
    /// Returns to the render before or after this one.
    Return(HistoryStep),
    /// Opens the scene with this index in the hub's list.
    OpenScene(usize),
    /// Writes the image as it is now.
    Save,
    /// Sends all values at a pixel to `reply`, as JSON.
    Inspect {
        pixel: [u32; 2],
        reply: mpsc::Sender<String>,
    },
}
