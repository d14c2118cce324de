//! Tests the live page's server with requests and viewers of their own, friendly or not: no browser is needed.

mod live;
mod process;

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tungstenite::Message;

use live::{SCENE, Socket, preview, viewer};
use process::{Running, first_line};

/// Returns the status of the answer to a request for the WebSocket with these headers.
fn socket_status(address: &str, path: &str, origin: Option<&str>, host: Option<&str>) -> u16 {
    use tungstenite::client::IntoClientRequest;
    let authority = address.trim_start_matches("http://").split('/').next().unwrap();
    let mut request = format!("ws://{authority}{path}").into_client_request().unwrap();
    if let Some(origin) = origin {
        request.headers_mut().insert("Origin", origin.parse().unwrap());
    }
    if let Some(host) = host {
        request.headers_mut().insert("Host", host.parse().unwrap());
    }
    match tungstenite::connect(request) {
        Ok((_, response)) => response.status().as_u16(),
        Err(tungstenite::Error::Http(response)) => response.status().as_u16(),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn no_other_page_can_open_the_socket() {
    let (_render, address, _folder) = preview(&["--spp", "1"]);
    let own = address.trim_end_matches('/');
    assert_eq!(socket_status(&address, "/live", Some(own), None), 101);
    assert_eq!(socket_status(&address, "/live", None, None), 403);
    assert_eq!(socket_status(&address, "/live", Some("http://evil.example"), None), 403);
    let rebound = Some("evil.example:80");
    assert_eq!(socket_status(&address, "/live", Some("http://evil.example:80"), rebound), 403);
}

#[test]
fn an_address_that_is_given_needs_the_printed_token() {
    let (_render, address, _folder) = preview(&["--spp", "1", "--preview", "127.0.0.1:0"]);
    let (own, query) = address.split_once("/?").expect("a token in the address");
    assert_eq!(socket_status(&address, &format!("/live?{query}"), Some(own), None), 101);
    assert_eq!(socket_status(&address, "/live", Some(own), None), 403);
    assert_eq!(socket_status(&address, "/live?token=0", Some(own), None), 403);
}

fn send(socket: &mut Socket, message: &str) {
    socket.send(Message::text(message)).expect("an open socket");
}

#[test]
fn each_command_is_answered_in_its_turn_and_nothing_else_is() {
    let (_render, address, _folder) = preview(&["--spp", "1"]);
    let mut socket = viewer(&address);
    for message in [
        r#"{"type":"views","views":[]}"#,
        r#"{"type":"restart"}"#,
        r#"{"type":"alive"}"#,
        r#"{"type":"launch"}"#,
        r#"{"type":"ready"}"#,
        r#"{"type":"pause","paused":false}"#,
    ] {
        send(&mut socket, message);
    }
    let mut answers = Vec::new();
    while answers.len() < 3 {
        let Message::Text(text) = socket.read().expect("a message") else { continue };
        let answer: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        answers.extend(
            answer["type"].as_str().filter(|kind| ["queued", "refused"].contains(kind)).map(str::to_owned),
        );
    }
    assert_eq!(answers, ["queued", "refused", "queued"]);
}

/// Returns the bytes of the image that begins with this piece.
fn image_length(piece: &[u8]) -> usize {
    let side = |at: usize| usize::from(u16::from_le_bytes([piece[at], piece[at + 1]]));
    let squares = |at: usize| side(at).div_ceil(piece[24].into());
    28 + 2 * usize::from(piece[2]) * squares(4) * squares(6)
}

/// Reads until the status says that the render has finished, and takes all images; returns their number.
fn watch_to_the_end(socket: &mut Socket) -> u32 {
    let (mut images, mut missing) = (0, 0);
    loop {
        match socket.read().expect("an open socket") {
            Message::Binary(piece) => {
                assert!(piece.len() <= 256 << 10, "a slow link takes a piece in time");
                if missing == 0 {
                    missing = image_length(&piece);
                }
                missing -= piece.len();
                if missing == 0 {
                    images += 1;
                    send(socket, r#"{"type":"ready"}"#);
                }
            }
            Message::Text(text) if text.contains(r#""phase":"finished""#) => return images,
            _ => {}
        }
    }
}

#[test]
fn a_viewer_that_never_reads_delays_neither_the_render_nor_another() {
    let (_render, address, _folder) = preview(&["--spp", "100", "--resolution", "512x512"]);
    let look = r#"{"type":"views","views":["raw","samples","variance"]}"#;
    let mut deaf: Vec<Socket> = (0..3).map(|_| viewer(&address)).collect();
    for socket in &mut deaf {
        send(socket, look);
        (0..50).for_each(|_| send(socket, r#"{"type":"ready"}"#));
    }
    let mut socket = viewer(&address);
    send(&mut socket, look);
    send(&mut socket, r#"{"type":"ready"}"#);
    assert!(watch_to_the_end(&mut socket) > 2);
}

#[test]
fn a_command_does_not_wait_until_a_slow_viewer_has_its_image() {
    let (_render, address, _folder) =
        preview(&["--spp", "1000", "--denoiser", "none", "--resolution", "1536x1536"]);
    let mut slow = viewer(&address);
    send(&mut slow, r#"{"type":"views","views":["raw"]}"#);
    send(&mut slow, r#"{"type":"ready"}"#);
    let next_piece = |socket: &mut Socket| loop {
        if let Message::Binary(piece) = socket.read().expect("an open socket") {
            return piece;
        }
    };
    // Coarse images may come first
    let mut missing = 0;
    while missing < 8 << 20 {
        let piece = next_piece(&mut slow);
        missing = if missing == 0 { image_length(&piece) } else { missing } - piece.len();
        if missing == 0 {
            send(&mut slow, r#"{"type":"ready"}"#);
        }
    }
    send(&mut slow, r#"{"type":"pause","paused":true}"#);
    let read = Arc::new(AtomicUsize::new(0));
    let reader = std::thread::spawn({
        let read = read.clone();
        move || {
            while read.load(Ordering::Relaxed) < missing {
                read.fetch_add(next_piece(&mut slow).len(), Ordering::Relaxed);
                std::thread::sleep(std::time::Duration::from_millis(50));
            }
        }
    });
    let mut watcher = viewer(&address);
    while !matches!(watcher.read().expect("an open socket"),
        Message::Text(text) if text.contains(r#""is_paused":true"#))
    {}
    assert!(read.load(Ordering::Relaxed) < missing / 2, "{} of {missing}", read.load(Ordering::Relaxed));
    reader.join().expect("the whole image");
}

#[cfg(target_os = "linux")]
#[test]
fn a_finished_render_leaves_the_processor_idle() {
    let (render, address, _folder) = preview(&["--spp", "4"]);
    let mut socket = viewer(&address);
    send(&mut socket, r#"{"type":"views","views":["filtered","failure"]}"#);
    send(&mut socket, r#"{"type":"ready"}"#);
    watch_to_the_end(&mut socket);
    // Hundredths of a second of the processor, by user and system.
    let ticks = || -> u64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", render.0.id())).expect("a process");
        let (_, after_name) = stat.rsplit_once(')').expect("its name");
        after_name.split_whitespace().skip(11).take(2).map(|n| n.parse::<u64>().expect("a number")).sum()
    };
    // After the last image has been sent.
    std::thread::sleep(std::time::Duration::from_millis(700));
    let before = ticks();
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(ticks() - before <= 10, "{} hundredths in two seconds", ticks() - before);
}

#[test]
fn a_message_that_is_too_long_or_wrong_stops_neither_the_server_nor_the_render() {
    let (_render, address, _folder) = preview(&["--spp", "1"]);
    let mut socket = viewer(&address);
    let _ = socket.send(Message::text("x".repeat(1 << 20)));
    while socket.read().is_ok() {}
    let mut socket = viewer(&address);
    socket.send(Message::text("{\"type\":\"launch\"}")).unwrap();
    let refused = |message: &Message| message.to_text().is_ok_and(|text| text.contains("refused"));
    while !refused(&socket.read().expect("an answer")) {}
}

/// Returns the status of the answer to a request whether a viewer would be admitted.
fn admission(address: &str) -> String {
    use std::io::{Read, Write};
    let (own, query) = address.split_once("/?").unwrap_or((address.trim_end_matches('/'), ""));
    let authority = own.trim_start_matches("http://");
    let mut stream = std::net::TcpStream::connect(authority).expect("a connection");
    write!(stream, "GET /admission?{query} HTTP/1.1\r\nHost: {authority}\r\nConnection: close\r\n\r\n")
        .expect("a request");
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    answer.split_whitespace().nth(1).unwrap_or_default().to_owned()
}

#[test]
fn a_page_learns_why_it_is_not_admitted_and_silent_viewers_make_room_within_ten_seconds() {
    let (_render, address, _folder) = preview(&["--spp", "1"]);
    assert_eq!(admission(&address), "204");
    let _silent: Vec<Socket> = (0..16).map(|_| viewer(&address)).collect();
    let since = std::time::Instant::now();
    assert_eq!(admission(&address), "503");
    while admission(&address) == "503" {
        assert!(since.elapsed().as_secs() < 10, "silent viewers stay");
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    assert!(since.elapsed().as_secs() > 4, "{:?}", since.elapsed());

    let (_render, address, _folder) = preview(&["--spp", "1", "--preview", "127.0.0.1:0"]);
    assert_eq!(admission(&address), "204");
    assert_eq!(admission(&format!("{address}0")), "403");
}

#[test]
fn viewers_that_answer_pings_stay() {
    let (_render, address, _folder) = preview(&["--spp", "1"]);
    let mut socket = viewer(&address);
    let since = std::time::Instant::now();
    while since.elapsed().as_secs() < 11 {
        // Reading answers pings.
        socket.read().expect("an open socket");
    }
}

/// Opens so many connections that each send half a request.
fn half_requests(address: &str, number: usize) -> Vec<std::net::TcpStream> {
    use std::io::Write;
    let authority = address.trim_start_matches("http://").split('/').next().expect("a host and port");
    let open = |_| {
        let mut stream = std::net::TcpStream::connect(authority).expect("a connection");
        // The server may have closed it already.
        let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: half\r\n");
        stream
    };
    (0..number).map(open).collect()
}

/// A process that may open 256 files, and a client that holds 500 connections.
#[cfg(target_os = "linux")]
#[test]
fn clients_that_hold_connections_keep_nothing_from_being_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).expect("a file in it");
    let mut render = Command::new("sh")
        .current_dir(folder.path())
        .args(["-c", "ulimit -n 256; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_prpf"), "render", "scene.pbrt"])
        .args(["--preview", "127.0.0.1:0", "--spp", "0", "--time", "4s", "--quiet", "-o", "out.exr"])
        .args(["--state", "out.state", "--report", "out.json"])
        .stdout(Stdio::piped())
        .spawn()
        .map(Running)
        .expect("the program starts");
    let output = render.0.stdout.take().expect("it was asked for");
    let address = first_line(output, |line| line.strip_prefix("preview at ").map(str::to_owned));
    let address = address.expect("the program says where the page is");
    let _held = half_requests(&address, 500);
    // The page can still be opened.
    let (own, query) = address.split_once("/?").expect("a token in the address");
    assert_eq!(socket_status(&address, &format!("/live?{query}"), Some(own), None), 101);
    assert!(render.0.wait().expect("it ends").success());
    for name in ["out.exr", "out.state", "out.json"] {
        assert!(folder.path().join(name).metadata().is_ok_and(|file| file.len() > 100), "{name}");
    }
}

#[test]
fn a_request_that_does_not_end_is_dropped_after_ten_seconds() {
    use std::io::Read;
    let (_render, address, _folder) = preview(&["--spp", "1"]);
    let mut half = half_requests(&address, 1);
    let started = std::time::Instant::now();
    half[0].set_read_timeout(Some(std::time::Duration::from_secs(15))).expect("a socket");
    let _ = half[0].read_to_end(&mut Vec::new()).expect("the server closes the connection");
    assert!((8..14).contains(&started.elapsed().as_secs()), "{:?}", started.elapsed());
}

/// Pages that all lose their connection connect again at once.
#[test]
fn after_a_storm_of_connections_there_is_a_place_and_an_image() {
    let (_render, address, _folder) = preview(&["--spp", "0"]);
    let own = address.trim_end_matches('/').to_owned();
    let answers = std::thread::scope(|scope| {
        let visit = || (0..40).map(|_| socket_status(&own, "/live", Some(&own), None)).collect::<Vec<_>>();
        let storm: Vec<_> = (0..24).map(|_| scope.spawn(visit)).collect();
        storm.into_iter().flat_map(|visits| visits.join().expect("answers")).collect::<Vec<_>>()
    });
    assert!(answers.iter().all(|status| [101, 503].contains(status)), "{answers:?}");
    // The places of those that have gone become free within moments
    let is_free = || socket_status(&own, "/live", Some(&own), None) == 101;
    assert!((0..50).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(100));
        is_free()
    }));
    std::thread::sleep(std::time::Duration::from_millis(100));
    let mut socket = viewer(&address);
    send(&mut socket, r#"{"type":"views","views":["raw"]}"#);
    send(&mut socket, r#"{"type":"ready"}"#);
    while !matches!(socket.read().expect("a message"), Message::Binary(_)) {}
}

/// Viewers that connect, send every command many times, read little, and leave. `PRPF_VIEWERS=8640` for as many as come
/// in 24 hours, one each ten seconds.
#[cfg(target_os = "linux")]
#[test]
fn viewers_that_come_and_go_take_little_memory() {
    let viewers = std::env::var("PRPF_VIEWERS").ok().and_then(|text| text.parse().ok()).unwrap_or(200);
    let (render, address, _folder) = preview(&["--spp", "0"]);
    let resident = || -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", render.0.id())).expect("a process");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
        line.trim().trim_end_matches("kB").trim().parse::<u64>().expect("kibibytes") / 1024
    };
    let visit = |index: usize| {
        let mut socket = viewer(&address);
        for message in [
            r#"{"type":"views","views":["raw","filtered"]}"#,
            r#"{"type":"ready"}"#,
            r#"{"type":"inspect","x":3,"y":4}"#,
            r#"{"type":"camera","orbit":[0.01,0]}"#,
            r#"{"type":"priority-region","region":[[0.2,0.5],[0.1,0.5]]}"#,
            r#"{"type":"settings","sampling":"uniform"}"#,
            r#"{"type":"settings","sampling":"adaptive"}"#,
            r#"{"type":"settings","denoiser":"none"}"#,
            r#"{"type":"settings","denoiser":"nlm"}"#,
            r#"{"type":"camera","focus_at":[4,4]}"#,
            r#"{"type":"add-bookmark"}"#,
            r#"{"type":"remove-bookmark","number":1}"#,
            r#"{"type":"restart"}"#,
            r#"{"type":"undo"}"#,
            r#"{"type":"redo"}"#,
            r#"{"type":"open-scene","index":7}"#,
            r#"{"type":"save"}"#,
            r#"{"type":"alive"}"#,
            r#"{"type":"pause","paused":true}"#,
            r#"{"type":"pause","paused":false}"#,
            r#"{"type":"launch"}"#,
        ] {
            // A server that does not take more refuses, and this is no reason to stop.
            (0..10).for_each(|_| drop(socket.send(Message::text(message))));
        }
        // Every fourth viewer stays until all its messages are handled: the last ones are refused.
        let mut refusals = if index.is_multiple_of(4) { 10 } else { 0 };
        while refusals > 0 {
            let answer = socket.read().expect("an answer");
            let is_unknown = |text: &str| text.contains("refused") && text.contains("launch");
            refusals -= u32::from(answer.to_text().is_ok_and(is_unknown));
        }
    };
    (0..100).for_each(visit);
    let before = resident();
    (0..viewers).for_each(visit);
    let after = resident();
    println!("{before} MiB after 100 viewers, {after} MiB after {viewers} more");
    assert!(after < before + 64, "{before} MiB, then {after} MiB");
}
