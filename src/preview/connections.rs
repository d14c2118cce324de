//! Accepts the server's TCP connections, within limits of number and time.
//!
//! Takes a listener and a router. Every connection occupies a file descriptor of the process, which also writes images
//! and states: whatever clients do, their connections leave enough of them. When there are too many connections, the
//! oldest one is closed. A browser's request is answered within milliseconds, so those that clients merely hold open go
//! first, and the page can still be opened.
//!
//! A connection that has become a WebSocket no longer counts here; the server limits viewers on its own.

use std::collections::VecDeque;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::AbortHandle;

/// Most connections at a time, viewers not counted. A browser opens six to one host.
const MOST_CONNECTIONS: u64 = 64;
/// File descriptors that are left to outputs, inputs and viewers, if the process may have that many.
const RESERVED_DESCRIPTORS: u64 = 96;
/// Fewest connections, however few descriptors the process may have: enough for one browser.
const FEWEST_CONNECTIONS: u64 = 6;
/// Longest time for the header of a request to arrive; an idle connection is closed after the same time.
const HEADER_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest life of a connection: as long as a slow link takes for a large saved image. Browsers open another one when they need it.
const CONNECTION_TIMEOUT: Duration = Duration::from_secs(20 * 60);
/// Longest header of a request, in bytes.
const LONGEST_HEADER: usize = 16 << 10;
/// Time to wait after the system could not accept a connection.
const ACCEPT_RETRY: Duration = Duration::from_millis(100);

/// Accepts connections for ever, and answers their requests by `router`.
pub async fn accept(listener: TcpListener, router: Router) {
    let most = most_connections(descriptor_limit()) as usize;
    let mut open = VecDeque::<AbortHandle>::with_capacity(most);
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(ACCEPT_RETRY).await;
            continue;
        };
        open.retain(|connection| !connection.is_finished());
        if open.len() >= most
            && let Some(oldest) = open.pop_front()
        {
            oldest.abort();
        }
        open.push_back(tokio::spawn(serve(stream, router.clone())).abort_handle());
        // Lets the aborted connection close before another one is accepted.
        tokio::task::yield_now().await;
    }
}

/// Serves one connection until it ends, becomes a WebSocket, or has lasted too long.
async fn serve(stream: TcpStream, router: Router) {
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER_TIMEOUT)
        .max_buf_size(LONGEST_HEADER)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades();
    // A connection that fails or is too slow concerns its client alone.
    let _ = tokio::time::timeout(CONNECTION_TIMEOUT, connection).await;
}

/// Returns the most connections of a process that may have `descriptors` open files.
fn most_connections(descriptors: u64) -> u64 {
    descriptors.saturating_sub(RESERVED_DESCRIPTORS).clamp(FEWEST_CONNECTIONS, MOST_CONNECTIONS)
}

/// Returns how many files this process may have open.
fn descriptor_limit() -> u64 {
    #[cfg(unix)]
    let limit = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    #[cfg(not(unix))]
    let limit = None;
    limit.unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_leave_descriptors_to_outputs() {
        assert_eq!(most_connections(u64::MAX), MOST_CONNECTIONS);
        assert_eq!(most_connections(1024), MOST_CONNECTIONS);
        assert_eq!(most_connections(128), 32);
        assert_eq!(most_connections(64), FEWEST_CONNECTIONS);
        assert!(descriptor_limit() > 0);
    }
}
