//! The live page: what a render looks like while it runs, and the handles to steer it.
//!
//! ```text
//! progressive loop ──► director ──► hub ──► server ──► page
//!        ▲                │  ▲       └────► display (tev)
//!        └── flow ────────┘  └───── commands ◄── page
//! ```
//!
//! The [`Director`] observes the loop on the loop's own thread. It publishes images to the [`Hub`],
//! which keeps the newest of each view, and obeys commands from a bounded channel. Whoever looks takes
//! the newest image when ready for one; nothing here ever waits for them.

mod access;
mod camera;
mod director;
mod frame;
mod hub;
mod page;
mod pass;
mod protocol;
mod publish;
mod reporter;
mod server;
mod stage;
mod status;
mod tev;
mod values;
mod view;
mod wishes;

pub use camera::Rig;
pub use director::Director;
pub use hub::Hub;
pub use protocol::{Change, Message, Move};
pub use server::{ServeError, Server};
pub use stage::{Keeping, Picture, Save, Stage};
pub use tev::Display;
pub use view::View;
