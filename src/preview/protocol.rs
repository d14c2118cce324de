//! The messages that the page sends: short JSON texts, which are checked before anything acts on them.
//!
//! The server sends texts (status, values of a pixel, reasons) and frames. It answers each command by `queued`, or
//! `refused` with a reason, in their order; a scene that is opened drops the queue. A frame comes in pieces of at most 256 KiB, each a
//! binary message, with no other message between two of them; the header at the start of the first one tells the length of the
//! whole (see [`super::preview_frame`]). On a slow link a ping waits behind the pieces: the page sends signs of life by itself
//! while they arrive.

use serde::Deserialize;
use tokio::sync::mpsc;

use super::camera_move::CameraMove;
use super::command::{Command, Rectangle};
use super::history::HistoryStep;
use super::settings_change::SettingsChange;
use super::view::View;

/// Longest message that is read, in bytes.
pub const LONGEST_MESSAGE: usize = 4096;

/// A message from the page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Message {
    /// Selects the views whose images the page wants.
    Views { views: Vec<View> },
    /// Asks for one more image: the page has drawn the one before.
    Ready {},
    /// A sign of life, while an image arrives.
    Alive {},
    /// Pauses the render or resumes it.
    Pause { paused: bool },
    /// Changes settings.
    Settings(SettingsChange),
    /// Moves the camera.
    Camera(CameraMove),
    /// Keeps the camera as a bookmark.
    AddBookmark {},
    /// Removes a bookmark.
    RemoveBookmark { number: usize },
    /// Sets the region that is rendered first; `null` ends that.
    PriorityRegion { region: Option<Rectangle> },
    /// Discards all samples.
    Restart {},
    /// Returns to the render that a command has replaced.
    Undo {},
    /// Takes back an undo.
    Redo {},
    /// Opens another scene of the list.
    OpenScene { index: usize },
    /// Writes the image as it is now.
    Save {},
    /// Asks for all values at a pixel.
    Inspect { x: u32, y: u32 },
}

impl Message {
    /// Reads and checks a message.
    ///
    /// # Errors
    /// One line: what is wrong with the message.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST_MESSAGE {
            return Err(format!("a message is at most {LONGEST_MESSAGE} bytes long"));
        }
        let message: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        message.check()?;
        Ok(message)
    }

    /// Converts the message to a command; an answer goes to `reply`.
    pub fn into_command(self, reply: &mpsc::Sender<String>) -> Command {
        match self {
            Message::Views { .. } | Message::Ready {} | Message::Alive {} => Command::Wake,
            Message::Pause { paused } => Command::Pause(paused),
            Message::Settings(change) => Command::ChangeSettings(change),
            Message::Camera(step) => Command::MoveCamera(step),
            Message::AddBookmark {} => Command::AddBookmark,
            Message::RemoveBookmark { number } => Command::RemoveBookmark(number),
            Message::PriorityRegion { region } => Command::SetRegion(region),
            Message::Restart {} => Command::Restart,
            Message::OpenScene { index } => Command::OpenScene(index),
            Message::Undo {} => Command::Return(HistoryStep::Undo),
            Message::Redo {} => Command::Return(HistoryStep::Redo),
            Message::Save {} => Command::Save,
            Message::Inspect { x, y } => Command::Inspect { pixel: [x, y], reply: reply.clone() },
        }
    }

    fn check(&self) -> Result<(), String> {
        match self {
            Message::Views { views } if views.len() > View::ALL.len() => {
                Err("`views` has more entries than there are views".to_owned())
            }
            Message::Settings(change) => change.check(),
            Message::Camera(step) => step.check(),
            Message::PriorityRegion { region: Some([[x0, x1], [y0, y1]]) } => {
                let ok = [(x0, x1), (y0, y1)].iter().all(|(a, b)| 0.0 <= **a && a < b && **b <= 1.0);
                if ok { Ok(()) } else { Err("`region` has to lie within the image".to_owned()) }
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::adaptive::Sampling;

    #[test]
    fn messages_are_read_as_the_page_writes_them() {
        let read = |text| Message::parse(text).unwrap();
        assert_eq!(
            read(r#"{"type":"views","views":["raw","failure"]}"#),
            Message::Views { views: vec![View::Raw, View::Failure] }
        );
        assert_eq!(
            read(r#"{"type":"settings","sampling":"uniform","spp":64}"#),
            Message::Settings(SettingsChange {
                sampling: Some(Sampling::Uniform),
                spp: Some(64),
                ..SettingsChange::default()
            })
        );
        assert_eq!(
            read(r#"{"type":"camera","orbit":[0.1,-0.2]}"#),
            Message::Camera(CameraMove { orbit: Some([0.1, -0.2]), ..CameraMove::default() })
        );
        assert_eq!(
            read(r#"{"type":"priority-region","region":null}"#),
            Message::PriorityRegion { region: None }
        );
        assert_eq!(read(r#"{"type":"ready"}"#), Message::Ready {});
        assert_eq!(read(r#"{"type":"alive"}"#), Message::Alive {});
    }

    #[test]
    fn values_out_of_range_and_unknown_names_are_refused() {
        for text in [
            "",
            "[]",
            r#"{"type":"launch"}"#,
            r#"{"type":"save","path":"/etc/passwd"}"#,
            r#"{"type":"views","views":["secret"]}"#,
            r#"{"type":"views","views":["raw","raw","raw","raw","raw","raw","raw","raw","raw","raw","raw","raw","raw"]}"#,
            r#"{"type":"camera","orbit":[1e30,0]}"#,
            r#"{"type":"camera","orbit":[0]}"#,
            r#"{"type":"camera","aperture":-1}"#,
            r#"{"type":"camera","dolly":1e39}"#,
            r#"{"type":"settings","seconds":-5}"#,
            r#"{"type":"settings","spp":-5}"#,
            r#"{"type":"settings","quality":"best"}"#,
            r#"{"type":"priority-region","region":[[0.5,0.2],[0,1]]}"#,
            r#"{"type":"priority-region","region":[[0,2],[0,1]]}"#,
            r#"{"type":"inspect","x":-1,"y":0}"#,
        ] {
            assert!(Message::parse(text).is_err(), "{text}");
        }
        let long = format!(r#"{{"type":"ready"{}}}"#, " ".repeat(LONGEST_MESSAGE));
        assert!(Message::parse(&long).unwrap_err().contains("4096"));
    }

    proptest! {
        #[test]
        fn no_text_makes_the_parser_panic(text in "\\PC*", noise in proptest::collection::vec(any::<f32>(), 2)) {
            let _ = Message::parse(&text);
            let _ = Message::parse(&format!(r#"{{"type":"camera","pan":{noise:?}}}"#));
        }
    }
}
