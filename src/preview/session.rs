//! Serves one viewer over its WebSocket: images and status out, messages in.
//!
//! A viewer gets one image at a time, and the next when it says that it is ready: a slow one gets fewer. An image comes in
//! pieces, each of which a slow link takes within the time-outs. Between them the viewer's commands are carried out.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::{Message as Packet, WebSocket};
use tokio::sync::{mpsc, watch};
use tokio::time::Interval;

use super::hub::{Frames, Hub};
use super::protocol::Message;
use super::viewer::Viewer;

/// Longest packet of an image, in bytes.
const LONGEST_PIECE: usize = 256 << 10;
/// A viewer that does not take a packet within this time is disconnected.
const SEND_TIMEOUT: Duration = Duration::from_secs(8);
/// Most messages of a viewer that are read between two pieces: fewer than commands may wait.
const MOST_BETWEEN_PIECES: usize = 128;
/// Time between two signs of life, and the longest silence of a viewer: a browser answers pings by itself.
const PING_INTERVAL: Duration = Duration::from_secs(2);
const LONGEST_SILENCE: Duration = Duration::from_secs(7);
/// Longest time to wait for a viewer's farewell.
const FAREWELL: Duration = Duration::from_millis(150);
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
    end: watch::Receiver<Option<Arc<str>>>,
    pulse: Interval,
    /// When the viewer has last sent or taken something.
    heard: Instant,
    /// Where the render sends its answers, and where they arrive.
    reply: mpsc::Sender<String>,
    replies: mpsc::Receiver<String>,
}

/// What to do after an event.
enum Next {
    Send(Vec<Packet>),
    /// Send a sign of life, and ask for one.
    Ping,
    /// Say why there will be nothing more.
    End(Arc<str>),
    Wait,
    Disconnect,
}

/// Serves a viewer until it disconnects.
pub async fn serve_viewer(mut socket: WebSocket, hub: Arc<Hub>) {
    let mut session = Session::new(hub);
    loop {
        let next = match session.next_frame() {
            Some(frame) => Next::Send(pieces(&frame)),
            None => session.next_event(&mut socket).await,
        };
        let packets = match next {
            Next::Send(packets) => packets,
            // A page does not see pings.
            Next::Ping => vec![Packet::Ping(Bytes::new()), message("alive", "")],
            Next::End(reason) => return end(&mut socket, &reason).await,
            Next::Wait => continue,
            Next::Disconnect => return,
        };
        let mut packets = VecDeque::from(packets);
        while let Some(packet) = packets.pop_front() {
            let is_frame = matches!(packet, Packet::Binary(_));
            let sent = tokio::time::timeout(SEND_TIMEOUT, socket.send(packet)).await;
            if !matches!(sent, Ok(Ok(()))) {
                return;
            }
            if is_frame {
                session.heard = Instant::now();
                // Commands do not wait for the rest of the image; their answers do
                for _ in 0..MOST_BETWEEN_PIECES {
                    let Some(next) = session.next_arrived(&mut socket).await else { break };
                    match next {
                        Next::Send(answers) => packets.extend(answers),
                        Next::Disconnect => return,
                        _ => {}
                    }
                }
            }
        }
    }
}

/// Tells a viewer why there will be nothing more, and waits a moment for its farewell: otherwise what it has sent would cut
/// off the message.
async fn end(socket: &mut WebSocket, reason: &str) {
    let farewell = async {
        socket.send(message("ended", reason)).await?;
        socket.send(Packet::Close(None)).await?;
        while let Some(Ok(_)) = socket.recv().await {}
        Ok::<(), axum::Error>(())
    };
    let _ = tokio::time::timeout(FAREWELL, farewell).await;
}

/// Returns a message with a reason.
fn message(kind: &str, reason: &str) -> Packet {
    Packet::Text(serde_json::json!({ "type": kind, "reason": reason }).to_string().into())
}

impl Session {
    fn new(hub: Arc<Hub>) -> Self {
        let (frames, mut status) = (hub.frames(), hub.status());
        // A new viewer gets the current status.
        status.mark_changed();
        let (reply, replies) = mpsc::channel(REPLY_QUEUE);
        let viewer = Viewer::new(hub.clone());
        let mut end = hub.ended();
        // It may have ended already.
        end.mark_changed();
        let pulse = tokio::time::interval(PING_INTERVAL);
        let heard = Instant::now();
        Self { hub, viewer, is_ready: false, frames, status, end, pulse, heard, reply, replies }
    }

    /// Returns a frame that the viewer has not had, if it is ready for one.
    fn next_frame(&mut self) -> Option<Bytes> {
        let frame = self.is_ready.then(|| self.viewer.take(&mut self.frames)).flatten()?;
        self.is_ready = false;
        self.viewer.set_ready(false);
        Some(frame.bytes.clone())
    }

    /// Waits for a message, a new frame, a new status or an answer.
    async fn next_event(&mut self, socket: &mut WebSocket) -> Next {
        tokio::select! {
            // What a viewer has sent counts before its silence does
            biased;
            packet = socket.recv() => self.receive(packet),
            changed = self.frames.changed(), if self.is_ready => match changed {
                Ok(()) => Next::Wait,
                Err(_) => Next::Disconnect,
            },
            changed = self.status.changed() => match changed {
                Ok(()) => self.current_status(),
                Err(_) => Next::Disconnect,
            },
            _ = self.end.changed() => match self.end.borrow_and_update().clone() {
                Some(reason) => Next::End(reason),
                None => Next::Wait,
            },
            _ = self.pulse.tick() => match self.heard.elapsed() > LONGEST_SILENCE {
                true => Next::Disconnect,
                false => Next::Ping,
            },
            Some(reply) = self.replies.recv() => Next::Send(vec![Packet::Text(reply.into())]),
        }
    }

    /// Acts on a packet that is there already; `None` without one.
    async fn next_arrived(&mut self, socket: &mut WebSocket) -> Option<Next> {
        tokio::select! {
            biased;
            packet = socket.recv() => Some(self.receive(packet)),
            () = std::future::ready(()) => None,
        }
    }

    /// Acts on a packet; `None` is the end of the connection.
    fn receive(&mut self, packet: Option<Result<Packet, axum::Error>>) -> Next {
        self.heard = Instant::now();
        match packet {
            Some(Ok(Packet::Text(text))) => self.handle_message(&text),
            Some(Ok(_)) => Next::Wait,
            Some(Err(_)) | None => Next::Disconnect,
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
            Ok(Message::Alive {}) => Next::Wait,
            Ok(Message::Ready {}) => {
                self.is_ready = true;
                self.viewer.set_ready(true);
                Next::Wait
            }
            Ok(message) => match self.hub.send(message.into_command(&self.reply)) {
                true => confirm(),
                false => refuse("too many commands are waiting; try again in a second"),
            },
            Err(problem) => refuse(&problem),
        }
    }

    fn current_status(&mut self) -> Next {
        let status = self.status.borrow_and_update().clone();
        if status.is_empty() { Next::Wait } else { Next::Send(vec![Packet::Text((&*status).into())]) }
    }
}

/// Says that a command waits for the render.
fn confirm() -> Next {
    Next::Send(vec![Packet::Text(serde_json::json!({ "type": "queued" }).to_string().into())])
}

fn refuse(reason: &str) -> Next {
    Next::Send(vec![message("refused", reason)])
}

/// Returns the packets of a frame.
fn pieces(frame: &Bytes) -> Vec<Packet> {
    let piece = |start: usize| Packet::Binary(frame.slice(start..frame.len().min(start + LONGEST_PIECE)));
    (0..frame.len()).step_by(LONGEST_PIECE).map(piece).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_short_and_make_up_the_frame() {
        let frame = Bytes::from((0..2 * LONGEST_PIECE + 7).map(|i| (i % 251) as u8).collect::<Vec<_>>());
        let pieces = pieces(&frame);
        let lengths: Vec<_> = pieces.iter().map(|piece| piece.clone().into_data().len()).collect();
        assert_eq!(lengths, [LONGEST_PIECE, LONGEST_PIECE, 7]);
        let joined: Vec<u8> = pieces.into_iter().flat_map(Packet::into_data).collect();
        assert!(joined == frame);
    }
}
