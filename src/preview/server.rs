//! Serves the page and its socket, on a thread of its own.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::extract::ws::{Message as Packet, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::mpsc;

use super::access::Access;
use super::hub::{Hub, Viewer};
use super::page;
use super::protocol::{LONGEST_MESSAGE, Message};

/// Where the page is if no address is given and nobody else is there.
const USUAL_PORT: u16 = 7377;
/// Viewers at a time.
const MOST_VIEWERS: usize = 16;
/// A viewer that takes nothing for so long is gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(20);
/// Answers that may wait for a viewer.
const WAITING_REPLIES: usize = 16;
/// Nothing comes from elsewhere, and no other page may frame this one.
const CONTENT_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
     connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Why a page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error("cannot listen on {address}")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error("cannot start the preview's server")]
    Start(#[from] std::io::Error),
}

/// A running server; it ends with the program.
pub struct Server {
    /// What to open in a browser.
    pub address: String,
}

#[derive(Clone)]
struct Shared {
    hub: Arc<Hub>,
    access: Arc<Access>,
    viewers: Arc<AtomicUsize>,
}

impl Server {
    /// Serves `hub` at an address, whose page then needs a token, or on this machine alone.
    ///
    /// # Errors
    /// The address cannot be listened to, or the system gives no thread or random number.
    pub fn start(hub: Arc<Hub>, address: Option<SocketAddr>) -> Result<Self, ServeError> {
        let access = if address.is_some() { Access::with_token()? } else { Access::local() };
        let local = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let listen = |address: SocketAddr| {
            TcpListener::bind(address).map_err(|source| ServeError::Listen { address, source })
        };
        let listener = match address {
            Some(address) => listen(address)?,
            None => listen(local(USUAL_PORT)).or_else(|_| listen(local(0)))?,
        };
        listener.set_nonblocking(true)?;
        let address = access.address(listener.local_addr()?);
        let shared = Shared { hub, access: Arc::new(access), viewers: Arc::default() };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        std::thread::Builder::new().name("preview".to_owned()).spawn(move || {
            runtime.block_on(async {
                let router = Router::new().route("/live", get(live)).fallback(get(file)).with_state(shared);
                if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                    // Serves until the program ends.
                    let _ = axum::serve(listener, router).await;
                }
            });
        })?;
        Ok(Self { address })
    }
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// A file of the page.
async fn file(State(shared): State<Shared>, headers: HeaderMap, uri: Uri) -> Response {
    let host = text(&headers, header::HOST);
    let allowed = match uri.path() {
        "/" => shared.access.admits(host, uri.query()),
        _ => shared.access.admits_files(host),
    };
    if !allowed {
        return (StatusCode::FORBIDDEN, "Open the address that prpf printed.\n").into_response();
    }
    let Some((kind, body)) = page::file(uri.path()) else {
        return StatusCode::NOT_FOUND.into_response();
    };
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::CONTENT_SECURITY_POLICY, CONTENT_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        // The address may hold a token.
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, body).into_response()
}

/// The socket.
async fn live(
    State(shared): State<Shared>,
    headers: HeaderMap,
    uri: Uri,
    upgrade: WebSocketUpgrade,
) -> Response {
    let (origin, host) = (text(&headers, header::ORIGIN), text(&headers, header::HOST));
    if !shared.access.admits_socket(origin, host, uri.query()) {
        return StatusCode::FORBIDDEN.into_response();
    }
    if shared.viewers.fetch_add(1, Ordering::Relaxed) >= MOST_VIEWERS {
        shared.viewers.fetch_sub(1, Ordering::Relaxed);
        return (StatusCode::SERVICE_UNAVAILABLE, "Too many viewers.\n").into_response();
    }
    let seat = Seat(shared.viewers.clone());
    let upgrade = upgrade.max_message_size(LONGEST_MESSAGE).max_frame_size(LONGEST_MESSAGE);
    upgrade.on_upgrade(move |socket| async move {
        attend(socket, shared.hub).await;
        drop(seat);
    })
}

/// Counts a viewer as long as it is there, also if its connection fails on the way.
struct Seat(Arc<AtomicUsize>);

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Serves one viewer until it goes. It gets one image at a time, and the next when it says that it is
/// ready: a slow one gets fewer.
async fn attend(mut socket: WebSocket, hub: Arc<Hub>) {
    let (mut frames, mut status) = (hub.frames(), hub.status());
    let (reply, mut replies) = mpsc::channel(WAITING_REPLIES);
    let mut viewer = Viewer::new(hub.clone());
    let mut ready = false;
    status.mark_changed();
    loop {
        let frame = if ready { viewer.take(&mut frames) } else { None };
        let packet = match frame {
            Some(frame) => {
                ready = false;
                viewer.ready(false);
                Packet::Binary(frame.bytes.clone())
            }
            None => tokio::select! {
                packet = socket.recv() => {
                    let Some(Ok(packet)) = packet else { return };
                    let Packet::Text(text) = packet else { continue };
                    match Message::parse(&text) {
                        Ok(Message::Look { views }) => {
                            viewer.look(&views);
                            viewer.ready(ready);
                            continue;
                        }
                        Ok(Message::Ready {}) => {
                            ready = true;
                            viewer.ready(true);
                            continue;
                        }
                        Ok(message) => {
                            if hub.command(message.command(&reply)) { continue }
                            refusal("too many commands wait")
                        }
                        Err(problem) => refusal(&problem),
                    }
                }
                changed = frames.changed(), if ready => {
                    if changed.is_err() { return }
                    continue;
                }
                changed = status.changed() => {
                    if changed.is_err() { return }
                    let status = status.borrow_and_update().clone();
                    if status.is_empty() { continue }
                    Packet::Text((&*status).into())
                }
                Some(reply) = replies.recv() => Packet::Text(reply.into()),
            },
        };
        if !matches!(tokio::time::timeout(SEND_TIMEOUT, socket.send(packet)).await, Ok(Ok(()))) {
            return;
        }
    }
}

fn refusal(reason: &str) -> Packet {
    Packet::Text(serde_json::json!({ "type": "refused", "reason": reason }).to_string().into())
}
