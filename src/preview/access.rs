//! Decides which requests the server answers.
//!
//! Any page on the web can make a browser connect to a local port. Every request is therefore checked for its origin:
//! by its `Host` and `Origin` headers, or by a token in its URL.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

/// Length of a token, in bytes: 128 bits cannot be guessed.
const TOKEN_BYTES: usize = 16;

/// The condition that requests have to meet.
#[derive(Clone, Debug)]
pub struct Access {
    token: Option<String>,
}

impl Access {
    /// Admits requests to this machine's own names, without a token.
    pub fn local() -> Self {
        Self { token: None }
    }

    /// Admits requests with a token, which is created here.
    ///
    /// # Errors
    /// The system provides no random numbers.
    pub fn with_token() -> std::io::Result<Self> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
        Ok(Self { token: Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect()) })
    }

    /// Returns the URL to open of a server that listens at `socket`.
    pub fn url(&self, socket: SocketAddr) -> String {
        let socket = openable(socket);
        match &self.token {
            Some(token) => format!("http://{socket}/?token={token}"),
            None => format!("http://{socket}/"),
        }
    }

    /// Tests whether a request may be answered, by its `Host` header and the query of its URL.
    ///
    /// Without a token the host has to be `localhost` or a loopback address: other names that resolve to it
    /// (DNS rebinding) are refused.
    pub fn admits(&self, host: Option<&str>, query: Option<&str>) -> bool {
        match &self.token {
            Some(token) => query
                .unwrap_or_default()
                .split('&')
                .filter_map(|pair| pair.strip_prefix("token="))
                .any(|given| equals_token(given, token)),
            None => host.is_some_and(is_loopback),
        }
    }

    /// Tests whether a file without secrets may be fetched, such as the page's scripts.
    pub fn admits_files(&self, host: Option<&str>) -> bool {
        self.token.is_some() || self.admits(host, None)
    }

    /// Tests whether a request comes from a page of this server or from the user, as far as the browser tells by the
    /// `Sec-Fetch-Site` header. Another page may not read the answer, but it could make the server work.
    pub fn is_own_request(site: Option<&str>) -> bool {
        matches!(site, None | Some("same-origin" | "none"))
    }

    /// Tests whether a WebSocket may be opened: only by a page of this server, according to the `Origin` header that
    /// browsers send.
    pub fn admits_socket(&self, origin: Option<&str>, host: Option<&str>, query: Option<&str>) -> bool {
        let from = origin.and_then(|origin| origin.split_once("://")).map(|(_, authority)| authority);
        self.admits(host, query) && from.is_some() && from == host
    }
}

/// Returns an address that a browser can open: a server that listens at all addresses of this machine (`0.0.0.0`, `[::]`)
/// has no such address itself. Returns that of the network interface towards other networks, else the loopback address.
fn openable(socket: SocketAddr) -> SocketAddr {
    if !socket.ip().is_unspecified() {
        return socket;
    }
    // Connecting a UDP socket chooses an interface and sends nothing; these networks are reserved for documentation.
    let towards = |from: IpAddr, to: IpAddr| {
        let chosen = UdpSocket::bind((from, 0)).and_then(|chosen| chosen.connect((to, 9)).map(|()| chosen));
        chosen.and_then(|chosen| chosen.local_addr()).ok().map(|address| address.ip())
    };
    let documentation: IpAddr = match socket {
        SocketAddr::V4(_) => Ipv4Addr::new(192, 0, 2, 1).into(),
        SocketAddr::V6(_) => Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1).into(),
    };
    let loopback: IpAddr = match socket {
        SocketAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
        SocketAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
    };
    SocketAddr::new(towards(socket.ip(), documentation).unwrap_or(loopback), socket.port())
}

/// Tests for `localhost` or a loopback address, with or without a port.
fn is_loopback(host: &str) -> bool {
    if host == "localhost" || host.starts_with("localhost:") {
        return true;
    }
    let address = host.parse::<SocketAddr>().map(|socket| socket.ip());
    let address = address.or_else(|_| host.trim_matches(['[', ']']).parse::<IpAddr>());
    address.is_ok_and(|address| address.is_loopback())
}

/// Compares in constant time, so that the time does not tell how much of a guess was right.
fn equals_token(given: &str, token: &str) -> bool {
    given.len() == token.len() && given.bytes().zip(token.bytes()).fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_token_only_this_machine_is_a_host() {
        let access = Access::local();
        for host in ["127.0.0.1:8080", "localhost:8080", "localhost", "[::1]:80", "127.0.0.1"] {
            assert!(access.admits(Some(host), None), "{host}");
        }
        for host in
            ["evil.example:8080", "localhost.evil.example", "192.168.0.7:80", "", "127.0.0.1.evil.example:1"]
        {
            assert!(!access.admits(Some(host), None), "{host}");
        }
        assert!(!access.admits(None, None));
    }

    #[test]
    fn another_page_cannot_open_the_socket() {
        let access = Access::local();
        let host = Some("127.0.0.1:8080");
        assert!(access.admits_socket(Some("http://127.0.0.1:8080"), host, None));
        for origin in [None, Some("http://evil.example"), Some("http://127.0.0.1:9999"), Some("null")] {
            assert!(!access.admits_socket(origin, host, None), "{origin:?}");
        }
    }

    #[test]
    fn an_address_that_listens_everywhere_is_printed_as_one_that_can_be_opened() {
        let access = Access::local();
        for everywhere in ["0.0.0.0:8080", "[::]:8080"] {
            let url = access.url(everywhere.parse().unwrap());
            let socket: SocketAddr = url["http://".len()..].trim_end_matches('/').parse().unwrap();
            assert!(!socket.ip().is_unspecified() && socket.port() == 8080, "{url}");
        }
        assert_eq!(access.url("192.168.0.7:80".parse().unwrap()), "http://192.168.0.7:80/");
    }

    #[test]
    fn a_given_address_needs_its_token() {
        let access = Access::with_token().unwrap();
        let socket = "192.168.0.7:8080".parse().unwrap();
        let address = access.url(socket);
        let query = address.split_once('?').map(|(_, query)| query);
        assert!(access.admits(Some("workstation:8080"), query));
        assert!(query.unwrap().len() == "token=".len() + 32);
        for wrong in [None, Some(""), Some("token="), Some("token=00000000000000000000000000000000")] {
            assert!(!access.admits(Some("192.168.0.7:8080"), wrong), "{wrong:?}");
        }
        assert_ne!(Access::with_token().unwrap().token, access.token);
    }

    #[test]
    fn requests_of_other_pages_are_known_by_their_header() {
        assert!([None, Some("none"), Some("same-origin")].into_iter().all(Access::is_own_request));
        assert!(!["cross-site", "same-site"].map(Some).into_iter().any(Access::is_own_request));
    }
}
