//! Serves the page over HTTP and its live connection over a WebSocket, on a thread of its own.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderName, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::Semaphore;

use super::access::Access;
use super::connections;
use super::hub::Hub;
use super::page;
use super::preview_frame::{FrameInfo, PreviewFrame};
use super::protocol::LONGEST_MESSAGE;
use super::session::serve_viewer;
use super::view::View;
use crate::image::read_rgb;

/// Port of the page if no address is given and the port is free.
const DEFAULT_PORT: u16 = 7377;
/// Most viewers at a time.
const MOST_VIEWERS: usize = 16;
/// Most saved images that are decoded at a time: each takes the memory of an image.
const MOST_DECODERS: usize = 2;
/// Longest time to wait until the viewers have heard of the end.
const FAREWELL: Duration = Duration::from_millis(300);
/// Content security policy: the page loads nothing from other hosts, and no other page may embed it.
const CONTENT_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
     connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error("cannot listen on {address}")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error("cannot start the preview's server")]
    Start(#[from] std::io::Error),
}

/// A running server; it ends with the process.
pub struct Server {
    /// The URL to open in a browser.
    pub address: String,
    shared: Shared,
}

#[derive(Clone)]
struct Shared {
    hub: Arc<Hub>,
    access: Arc<Access>,
    viewers: Arc<AtomicUsize>,
    decoders: Arc<Semaphore>,
}

impl Server {
    /// Serves `hub` at `address` to requests with a token; without an address, to this machine alone.
    ///
    /// # Errors
    /// The address is not available, or the system provides no thread or random numbers.
    pub fn start(hub: Arc<Hub>, address: Option<SocketAddr>) -> Result<Self, ServeError> {
        // Bind the port
        let access = if address.is_some() { Access::with_token()? } else { Access::local() };
        let local = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let listen = |address: SocketAddr| {
            TcpListener::bind(address).map_err(|source| ServeError::Listen { address, source })
        };
        let listener = match address {
            Some(address) => listen(address)?,
            None => listen(local(DEFAULT_PORT)).or_else(|_| listen(local(0)))?,
        };
        listener.set_nonblocking(true)?;

        // Serve on a thread of its own
        let address = access.url(listener.local_addr()?);
        let decoders = Arc::new(Semaphore::new(MOST_DECODERS));
        let shared = Shared { hub, access: Arc::new(access), viewers: Arc::default(), decoders };
        let state = shared.clone();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        std::thread::Builder::new().name("preview".to_owned()).spawn(move || {
            runtime.block_on(async {
                let router = Router::new()
                    .route("/live", get(live))
                    .route("/admission", get(admission))
                    .route("/scenes", get(scenes))
                    .route("/saves/{number}", get(saved_image))
                    .fallback(get(file))
                    .with_state(state);
                if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                    // Ends with the process.
                    connections::accept(listener, router).await;
                }
            });
        })?;
        Ok(Self { address, shared })
    }

    /// Tells all viewers why there will be nothing more, and waits a moment for them to hear it.
    pub fn close(self, reason: &str) {
        self.shared.hub.end(reason);
        let started = Instant::now();
        while self.shared.viewers.load(Ordering::Relaxed) > 0 && started.elapsed() < FAREWELL {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// Returns the text of a header.
fn text(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// Answers a request for a file of the page.
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
        // The URL may hold a token.
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, body).into_response()
}

/// Tells whether a WebSocket would be opened: a page is not told why one was refused.
async fn admission(State(shared): State<Shared>, headers: HeaderMap, uri: Uri) -> StatusCode {
    if !shared.access.admits(text(&headers, header::HOST), uri.query()) {
        StatusCode::FORBIDDEN
    } else if shared.viewers.load(Ordering::Relaxed) >= MOST_VIEWERS {
        StatusCode::SERVICE_UNAVAILABLE
    } else {
        StatusCode::NO_CONTENT
    }
}

/// Lists the scenes that can be opened.
async fn scenes(State(shared): State<Shared>, headers: HeaderMap, uri: Uri) -> Response {
    if !shared.access.admits(text(&headers, header::HOST), uri.query()) {
        return StatusCode::FORBIDDEN.into_response();
    }
    let names: Vec<String> = shared.hub.scenes().iter().map(|path| path.display().to_string()).collect();
    let headers = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    (headers, serde_json::json!(names).to_string()).into_response()
}

/// Sends a saved image, encoded as a frame.
async fn saved_image(
    State(shared): State<Shared>,
    headers: HeaderMap,
    uri: Uri,
    Path(number): Path<usize>,
) -> Response {
    let is_own = Access::is_own_request(text(&headers, HeaderName::from_static("sec-fetch-site")));
    if !is_own || !shared.access.admits(text(&headers, header::HOST), uri.query()) {
        return StatusCode::FORBIDDEN.into_response();
    }
    let Some(path) = shared.hub.saves().path(number) else {
        return StatusCode::NOT_FOUND.into_response();
    };
    let Ok(permit) = shared.decoders.acquire_owned().await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    let read = move || {
        // Held until the image is decoded, also where the client has gone.
        let _permit = permit;
        let planes = read_rgb(&path).map_err(|error| error.to_string())?;
        let info = FrameInfo { generation: 0, sequence: 0, spp: 0.0, seconds: 0.0, side: 1 };
        Ok::<_, String>(PreviewFrame::new(View::Raw, &planes, None, info).bytes)
    };
    match tokio::task::spawn_blocking(read).await {
        Ok(Ok(bytes)) => ([(header::CACHE_CONTROL, "no-store")], bytes).into_response(),
        Ok(Err(problem)) => (StatusCode::NOT_FOUND, problem).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

/// Answers a request for the WebSocket.
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
    let guard = ViewerGuard(shared.viewers.clone());
    let upgrade = upgrade.max_message_size(LONGEST_MESSAGE).max_frame_size(LONGEST_MESSAGE);
    upgrade.on_upgrade(move |socket| async move {
        serve_viewer(socket, shared.hub).await;
        drop(guard);
    })
}

/// Counts a viewer until it is dropped, also if the upgrade to a WebSocket fails.
struct ViewerGuard(Arc<AtomicUsize>);

impl Drop for ViewerGuard {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
