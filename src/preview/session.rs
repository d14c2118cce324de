//! Serves one viewer over its WebSocket: images and status out, messages in.
//!
//! A viewer gets one image at a time, and the next when it says that it is ready: a slow one gets fewer.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message as Packet, WebSocket};
use tokio::sync::{mpsc, watch};

use super::hub::{Frames, Hub};
use super::protocol::Message;
use super::viewer::Viewer;

/// A viewer that does not take a packet within this time is disconnected.
const SEND_TIMEOUT: Duration = Duration::from_secs(20);
/// Length of the queue of answers to a viewer.
const REPLY_QUEUE: usize = 16;

/// One viewer's connection to the hub.
struct Session {
    hub: Arc<Hub>,
    viewer: Viewer,
    /// Whether the viewer has drawn its last image.
    is_ready: bool,
    frames: watch::Receiver<Frames>,
    status: watch::Receiver<Arc<str>>,
    /// Where the render sends its answers, and where they arrive.
    reply: mpsc::Sender<String>,
    replies: mpsc::Receiver<String>,
}

/// What to do after an event.
enum Next {
    Send(Packet),
    Wait,
    Disconnect,
}

/// Serves a viewer until it disconnects.
pub async fn serve_viewer(mut socket: WebSocket, hub: Arc<Hub>) {
    let mut session = Session::new(hub);
    loop {
        let next = match session.next_frame() {
            Some(packet) => Next::Send(packet),
            None => session.next_event(&mut socket).await,
        };
        match next {
            Next::Send(packet) => {
                let sent = tokio::time::timeout(SEND_TIMEOUT, socket.send(packet)).await;
                if !matches!(sent, Ok(Ok(()))) {
                    return;
                }
            }
            Next::Wait => {}
            Next::Disconnect => return,
        }
    }
}

impl Session {
    fn new(hub: Arc<Hub>) -> Self {
        let (frames, mut status) = (hub.frames(), hub.status());
        // A new viewer gets the current status.
        status.mark_changed();
        let (reply, replies) = mpsc::channel(REPLY_QUEUE);
        let viewer = Viewer::new(hub.clone());
        Self { hub, viewer, is_ready: false, frames, status, reply, replies }
    }

    /// Returns a frame that the viewer has not had, if it is ready for one.
    fn next_frame(&mut self) -> Option<Packet> {
        let frame = self.is_ready.then(|| self.viewer.take(&mut self.frames)).flatten()?;
        self.is_ready = false;
        self.viewer.set_ready(false);
        Some(Packet::Binary(frame.bytes.clone()))
    }

    /// Waits for a message, a new frame, a new status or an answer.
    async fn next_event(&mut self, socket: &mut WebSocket) -> Next {
        tokio::select! {
            packet = socket.recv() => match packet {
                Some(Ok(Packet::Text(text))) => self.handle_message(&text),
                Some(Ok(_)) => Next::Wait,
                Some(Err(_)) | None => Next::Disconnect,
            },
            changed = self.frames.changed(), if self.is_ready => match changed {
                Ok(()) => Next::Wait,
                Err(_) => Next::Disconnect,
            },
            changed = self.status.changed() => match changed {
                Ok(()) => self.current_status(),
                Err(_) => Next::Disconnect,
            },
            Some(reply) = self.replies.recv() => Next::Send(Packet::Text(reply.into())),
        }
    }

    /// Acts on a message from the page.
    fn handle_message(&mut self, text: &str) -> Next {
        match Message::parse(text) {
            Ok(Message::Views { views }) => {
                self.viewer.select(&views);
                self.viewer.set_ready(self.is_ready);
                Next::Wait
            }
            Ok(Message::Ready {}) => {
                self.is_ready = true;
                self.viewer.set_ready(true);
                Next::Wait
            }
            Ok(message) => match self.hub.send(message.into_command(&self.reply)) {
                true => Next::Wait,
                false => refuse("too many commands are waiting"),
            },
            Err(problem) => refuse(&problem),
        }
    }

    fn current_status(&mut self) -> Next {
        let status = self.status.borrow_and_update().clone();
        if status.is_empty() { Next::Wait } else { Next::Send(Packet::Text((&*status).into())) }
    }
}

fn refuse(reason: &str) -> Next {
    Next::Send(Packet::Text(serde_json::json!({ "type": "refused", "reason": reason }).to_string().into()))
}
