//! What a page may say: short JSON texts, checked before anything is done with them.

use serde::Deserialize;
use tokio::sync::mpsc;

use super::view::View;
use crate::adaptive::Sampling;
use crate::filter::Quality;
use crate::progressive::{Denoiser, Settings};

/// Longest message that is read, in bytes.
pub const LONGEST_MESSAGE: usize = 4096;
/// Farthest that one message turns the camera, in radians.
const LARGEST_TURN: f32 = std::f32::consts::TAU;
/// Farthest that one message pans, in image heights, or dollies, in powers of e.
const LARGEST_SHIFT: f32 = 4.0;
/// Largest number that a budget, a lens or a distance may be.
const LARGEST_SETTING: f64 = 1e9;

/// A message from the page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Message {
    /// Show me these views from now on.
    Look { views: Vec<View> },
    /// I have drawn what you sent and can take more.
    Ready {},
    /// Stop rendering, or go on.
    Pause { paused: bool },
    /// Follow other settings; what is absent stays.
    Set(Change),
    /// Move the camera.
    Camera(Move),
    /// Give this region the samples first: shares of the image's width and height, half open.
    Favour { region: Option<[[f32; 2]; 2]> },
    /// Forget all samples.
    Restart {},
    /// Write the image as it is.
    Save {},
    /// What are the values at this pixel?
    Inspect { x: u32, y: u32 },
}

/// Settings that can change while rendering. A budget of 0 is off.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    pub sampling: Option<Sampling>,
    pub denoiser: Option<Denoiser>,
    pub quality: Option<Quality>,
    pub spp: Option<u32>,
    pub seconds: Option<f64>,
    pub target_error: Option<f64>,
}

/// Movements of the camera, all optional.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Move {
    /// Around the point looked at: to the right and up, in radians.
    pub orbit: Option<[f32; 2]>,
    /// Along the image: shift of the picture to the right and down, in image heights.
    pub pan: Option<[f32; 2]>,
    /// Towards the point looked at: logarithm of the factor on the distance.
    pub dolly: Option<f32>,
    /// Radius of the lens, in scene units.
    pub aperture: Option<f32>,
    /// Distance in focus, in scene units.
    pub focus: Option<f32>,
    /// Focus on what is seen at this pixel.
    pub focus_at: Option<[u32; 2]>,
    /// Back to the scene's camera.
    #[serde(default)]
    pub reset: bool,
}

/// What the render is asked to do.
#[derive(Clone, Debug)]
pub enum Command {
    /// Somebody is ready for frames.
    Look,
    Pause(bool),
    Set(Change),
    Camera(Move),
    Favour(Option<[[f32; 2]; 2]>),
    Restart,
    Save,
    Inspect {
        pixel: [u32; 2],
        reply: mpsc::Sender<String>,
    },
}

impl Change {
    /// Changes settings; whether another filter makes the image from now on.
    pub fn apply(&self, settings: &mut Settings) -> bool {
        let on = |value: f64| Some(value).filter(|v| *v > 0.0);
        let before = settings.denoiser;
        settings.denoiser = self.denoiser.unwrap_or(before);
        settings.sampling = self.sampling.unwrap_or(settings.sampling);
        settings.quality = self.quality.unwrap_or(settings.quality);
        if let Some(spp) = self.spp {
            settings.budget.spp = Some(spp).filter(|spp| *spp > 0);
        }
        if let Some(seconds) = self.seconds {
            settings.budget.seconds = on(seconds);
        }
        if let Some(error) = self.target_error {
            settings.budget.target_error = on(error);
        }
        settings.denoiser != before
    }
}

impl Message {
    /// Reads and checks a message.
    ///
    /// # Errors
    /// One line: what was wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST_MESSAGE {
            return Err(format!("a message is at most {LONGEST_MESSAGE} bytes long"));
        }
        let message: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        message.check()?;
        Ok(message)
    }

    /// What the render is to do; answers go to `reply`.
    pub fn command(self, reply: &mpsc::Sender<String>) -> Command {
        match self {
            Message::Look { .. } | Message::Ready {} => Command::Look,
            Message::Pause { paused } => Command::Pause(paused),
            Message::Set(change) => Command::Set(change),
            Message::Camera(step) => Command::Camera(step),
            Message::Favour { region } => Command::Favour(region),
            Message::Restart {} => Command::Restart,
            Message::Save {} => Command::Save,
            Message::Inspect { x, y } => Command::Inspect { pixel: [x, y], reply: reply.clone() },
        }
    }

    fn check(&self) -> Result<(), String> {
        let within = |name: &str, values: &[f32], limit: f32| {
            let ok = values.iter().all(|v| v.abs() <= limit);
            if ok { Ok(()) } else { Err(format!("`{name}` has to be within ±{limit}")) }
        };
        let budget = |name: &str, value: Option<f64>| match value {
            Some(v) if !(0.0..=LARGEST_SETTING).contains(&v) => {
                Err(format!("`{name}` has to be from 0 (off) to {LARGEST_SETTING:e}"))
            }
            _ => Ok(()),
        };
        match self {
            Message::Look { views } if views.len() > View::ALL.len() => {
                Err("more views than there are".to_owned())
            }
            Message::Set(change) => {
                budget("spp", change.spp.map(f64::from))?;
                budget("seconds", change.seconds)?;
                budget("target_error", change.target_error)
            }
            Message::Camera(step) => {
                within("orbit", &step.orbit.unwrap_or_default(), LARGEST_TURN)?;
                within("pan", &step.pan.unwrap_or_default(), LARGEST_SHIFT)?;
                within("dolly", &[step.dolly.unwrap_or_default()], LARGEST_SHIFT)?;
                budget("aperture", step.aperture.map(f64::from))?;
                budget("focus", step.focus.map(f64::from))
            }
            Message::Favour { region: Some([[x0, x1], [y0, y1]]) } => {
                let ok = [(x0, x1), (y0, y1)].iter().all(|(a, b)| 0.0 <= **a && a < b && **b <= 1.0);
                if ok { Ok(()) } else { Err("`region` has to lie within the image".to_owned()) }
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn messages_are_read_as_the_page_writes_them() {
        let read = |text| Message::parse(text).unwrap();
        assert_eq!(
            read(r#"{"type":"look","views":["raw","failure"]}"#),
            Message::Look { views: vec![View::Raw, View::Failure] }
        );
        assert_eq!(
            read(r#"{"type":"set","sampling":"uniform","spp":64}"#),
            Message::Set(Change { sampling: Some(Sampling::Uniform), spp: Some(64), ..Change::default() })
        );
        assert_eq!(
            read(r#"{"type":"camera","orbit":[0.1,-0.2]}"#),
            Message::Camera(Move { orbit: Some([0.1, -0.2]), ..Move::default() })
        );
        assert_eq!(read(r#"{"type":"favour","region":null}"#), Message::Favour { region: None });
        assert_eq!(read(r#"{"type":"ready"}"#), Message::Ready {});
    }

    #[test]
    fn what_is_out_of_bounds_or_unknown_is_refused() {
        for text in [
            "",
            "[]",
            r#"{"type":"launch"}"#,
            r#"{"type":"save","path":"/etc/passwd"}"#,
            r#"{"type":"look","views":["secret"]}"#,
            r#"{"type":"look","views":["raw","raw","raw","raw","raw","raw","raw","raw","raw","raw"]}"#,
            r#"{"type":"camera","orbit":[1e30,0]}"#,
            r#"{"type":"camera","orbit":[0]}"#,
            r#"{"type":"camera","aperture":-1}"#,
            r#"{"type":"camera","dolly":1e39}"#,
            r#"{"type":"set","seconds":-5}"#,
            r#"{"type":"set","spp":-5}"#,
            r#"{"type":"set","quality":"best"}"#,
            r#"{"type":"favour","region":[[0.5,0.2],[0,1]]}"#,
            r#"{"type":"favour","region":[[0,2],[0,1]]}"#,
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
