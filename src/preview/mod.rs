//! The live page: shows a render while it runs, and steers it.
//!
//! ```text
//! render loop ◄──► controller ──► hub ──► server ──► page
//!                      ▲           └────► tev client ──► tev
//!                      └──── commands ◄── page
//! ```
//!
//! The [`Controller`] drives the render loop on its own thread. It publishes frames to the [`Hub`], which keeps the newest
//! of each view, and handles commands from a bounded queue. Viewers take the newest frame when they are ready for one; the
//! render never waits for them.
//!
//! | file | holds |
//! | --- | --- |
//! | `controller`, `controller_end`, `scene_sessions`, `pending`, `configuration`, `image_request`, `history`, `background_pass` | control of the render |
//! | `reporter`, `generation_record`, `status`, `notices` | the status of the render |
//! | `publisher`, `preview_frame` | encoded images for the viewers |
//! | `view`, `colour_scale`, `pixel_values`, `comparison`, `relative_error`, `saved_images` | what the page shows |
//! | `orbit_camera`, `camera_move`, `bookmarks` | the camera, its movements and its bookmarks |
//! | `hub`, `viewer` | between the render thread and its viewers |
//! | `protocol`, `command`, `settings_change` | messages from the page |
//! | `server`, `connections`, `session`, `access`, `page` | the web server |
//! | `tev_client`, `tev_packet` | the tev viewer |

mod access;
mod background_pass;
mod bookmarks;
mod camera_move;
mod colour_scale;
mod command;
mod comparison;
mod configuration;
mod connections;
mod controller;
mod controller_end;
mod generation_record;
mod history;
mod hub;
mod image_request;
mod notices;
mod orbit_camera;
mod page;
mod pending;
mod pixel_values;
mod preview_frame;
mod protocol;
mod publisher;
mod relative_error;
mod reporter;
mod saved_images;
mod scene_sessions;
mod server;
mod session;
mod settings_change;
mod status;
mod tev_client;
mod tev_packet;
mod view;
mod viewer;

pub use camera_move::CameraMove;
pub use configuration::{Configuration, PreviewHost, SavedImage, recorded_blocks};
pub use controller::Controller;
pub use controller_end::ControllerEnd;
pub use hub::Hub;
pub use orbit_camera::OrbitCamera;
pub use protocol::Message;
pub use scene_sessions::{SceneSession, SceneSessions};
pub use server::{ServeError, Server};
pub use settings_change::SettingsChange;
pub use tev_client::TevClient;
pub use view::View;
