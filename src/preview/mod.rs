//! The live page: shows a render while it runs, and steers it.
//!
//! ```text
//! progressive loop ──► director ──► hub ──► server ──► page
//!        ▲                │  ▲       └────► tev client ──► tev
//!        └── flow ────────┘  └───── commands ◄── page
//! ```
//!
//! The [`Director`] observes the loop on the loop's own thread. It publishes images to the [`Hub`],
//! which keeps the newest of each view, and obeys commands from a bounded queue. Viewers take
//! the newest image when they are ready for one; the render never waits for them.
//!
//! | file | holds |
//! | --- | --- |
//! | `director`, `wishes`, `stage` | control of the render |
//! | `reporter`, `status` | the status of the render |
//! | `publisher`, `preview_frame` | encoded images for the viewers |
//! | `view`, `colour_scale`, `pixel_values` | what the page shows |
//! | `orbit_camera`, `camera_move` | the camera and its movements |
//! | `hub`, `viewer` | between the render thread and its viewers |
//! | `protocol`, `command`, `settings_change` | messages from the page |
//! | `server`, `session`, `access`, `page` | the web server |
//! | `tev_client`, `tev_packet` | the tev viewer |

mod access;
mod camera_move;
mod colour_scale;
mod command;
mod director;
mod hub;
mod orbit_camera;
mod page;
mod pass;
mod pixel_values;
mod preview_frame;
mod protocol;
mod publisher;
mod reporter;
mod server;
mod session;
mod settings_change;
mod stage;
mod status;
mod tev_client;
mod tev_packet;
mod view;
mod viewer;
mod wishes;

pub use camera_move::CameraMove;
pub use director::Director;
pub use hub::Hub;
pub use orbit_camera::OrbitCamera;
pub use protocol::Message;
pub use server::{ServeError, Server};
pub use settings_change::SettingsChange;
pub use stage::{Keeping, Picture, Save, Stage};
pub use tev_client::TevClient;
pub use view::View;
