//! A headless Chromium, driven through its DevTools protocol: just enough to see a page and use it.

use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use crate::process::{Running, first_line};

/// How long anything may take before a test fails.
const PATIENCE: Duration = Duration::from_secs(30);

/// A page in a browser.
pub struct Page {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    session: String,
    next: u64,
    _browser: Running,
    _profile: tempfile::TempDir,
}

/// The browser's program, if this machine has one; else says that the test is skipped.
pub fn chromium() -> Option<&'static str> {
    let found = ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| {
        Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
    });
    if found.is_none() {
        println!("skipped: no chromium on this machine");
    }
    found
}

impl Page {
    /// Opens an address in a window of a size.
    pub fn open(program: &str, address: &str, [width, height]: [u32; 2]) -> Self {
        let profile = tempfile::tempdir().expect("a temporary folder");
        let mut browser = Command::new(program)
            .args(["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-port=0"])
            .args([
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--no-first-run",
                "--hide-scrollbars",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .map(Running)
            .expect("the browser starts");
        let errors = browser.0.stderr.take().expect("it was asked for");
        let devtools =
            first_line(errors, |line| line.strip_prefix("DevTools listening on ").map(str::to_owned));
        let (socket, _) =
            tungstenite::connect(devtools.expect("the browser says where it listens")).expect("it answers");
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        }
        let mut page = Self { socket, session: String::new(), next: 0, _browser: browser, _profile: profile };
        let target = page.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attached =
            page.call("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        page.session = attached["sessionId"].as_str().expect("a session").to_owned();
        page.resize([width, height]);
        page.go_to(address);
        page
    }

    /// Opens another address.
    pub fn go_to(&mut self, address: &str) {
        self.call("Page.enable", json!({}));
        self.call("Page.navigate", json!({ "url": address }));
    }

    pub fn resize(&mut self, [width, height]: [u32; 2]) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    /// Reloads the page and waits until it is there.
    pub fn reload(&mut self) {
        self.call("Page.enable", json!({}));
        self.call("Page.reload", json!({}));
        while self.read()["method"] != "Page.loadEventFired" {}
    }

    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.next += 1;
        let id = self.next;
        let mut call = json!({ "id": id, "method": method, "params": parameters });
        if !self.session.is_empty() {
            call["sessionId"] = self.session.clone().into();
        }
        self.socket.send(Message::text(call.to_string())).expect("the browser listens");
        loop {
            let answer = self.read();
            if answer["id"] == id {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
        }
    }

    /// The next message of the browser; null if it is no JSON.
    fn read(&mut self) -> Value {
        let message = self.socket.read().expect("the browser answers");
        serde_json::from_str(message.to_text().unwrap_or_default()).unwrap_or_default()
    }

    /// The value of an expression in the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", asked);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait(&mut self, expression: &str) {
        let started = Instant::now();
        while self.value(&format!("Boolean({expression})")) != Value::Bool(true) {
            if started.elapsed() > PATIENCE {
                let seen = self.value("document.body.innerText.slice(0, 1500)");
                panic!("waited in vain for {expression}; the page says {seen}");
            }
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Types a key, as DOM names it.
    pub fn key(&mut self, key: &str) {
        self.type_key(key, 0);
    }

    /// Types a key while Shift is held.
    pub fn shift_key(&mut self, key: &str) {
        self.type_key(key, 8);
    }

    fn type_key(&mut self, key: &str, modifiers: u32) {
        let text = match key {
            "Enter" => "\r",
            key if key.chars().count() == 1 => key,
            _ => "",
        };
        // What the browser itself does with a key goes by the code.
        let codes =
            [("Tab", 9), ("Enter", 13), ("Escape", 27), ("Home", 36), ("ArrowUp", 38), ("ArrowDown", 40)];
        let code = codes.iter().find(|(name, _)| *name == key).map_or(0, |(_, code)| *code);
        for kind in ["keyDown", "keyUp"] {
            let event = json!({
                "type": kind, "key": key, "text": text, "modifiers": modifiers, "windowsVirtualKeyCode": code
            });
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Presses the left button at the first point, moves the mouse over the others and lets go at the last.
    pub fn drag(&mut self, points: &[[f64; 2]]) {
        self.drag_with("left", 0, points);
    }

    /// The same with a button while keys are held: 2 is Ctrl, 8 is Shift.
    pub fn drag_with(&mut self, button: &str, modifiers: u32, points: &[[f64; 2]]) {
        let held = if button == "left" { 1 } else { 2 };
        let mut mouse = |kind: &str, [x, y]: [f64; 2], buttons: u32| {
            let event = json!({
                "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1,
                "modifiers": modifiers
            });
            self.call("Input.dispatchMouseEvent", event);
        };
        mouse("mouseMoved", points[0], 0);
        mouse("mousePressed", points[0], held);
        points[1..].iter().for_each(|&point| mouse("mouseMoved", point, held));
        mouse("mouseReleased", points[points.len() - 1], 0);
    }

    /// Puts two fingers at the first pair of points, moves them over the others and lifts them.
    pub fn pinch(&mut self, pairs: &[[[f64; 2]; 2]]) {
        let mut touch = |kind: &str, pair: &[[f64; 2]]| {
            let points = pair.iter().enumerate().map(|(id, [x, y])| json!({ "x": x, "y": y, "id": id }));
            let event = json!({ "type": kind, "touchPoints": points.collect::<Vec<_>>() });
            self.call("Input.dispatchTouchEvent", event);
        };
        touch("touchStart", &pairs[0]);
        pairs[1..].iter().for_each(|pair| touch("touchMove", pair));
        touch("touchEnd", &[]);
    }

    /// Touches a point and lets go.
    pub fn tap_at(&mut self, [x, y]: [f64; 2]) {
        self.call(
            "Input.dispatchTouchEvent",
            json!({ "type": "touchStart", "touchPoints": [{ "x": x, "y": y }] }),
        );
        self.call("Input.dispatchTouchEvent", json!({ "type": "touchEnd", "touchPoints": [] }));
    }

    /// Scrolls to an element and touches its middle.
    pub fn tap(&mut self, selector: &str) {
        let middle = self.middle(selector);
        self.tap_at(middle);
    }

    /// Puts a finger at the first point, moves it over the others and lifts it after a rest: a finger that is lifted in motion
    /// flings, and the browser takes the next touch for the end of that.
    pub fn swipe(&mut self, points: &[[f64; 2]]) {
        for (i, [x, y]) in points.iter().enumerate() {
            let kind = if i == 0 { "touchStart" } else { "touchMove" };
            let event = json!({ "type": kind, "touchPoints": [{ "x": x, "y": y }] });
            self.call("Input.dispatchTouchEvent", event);
        }
        std::thread::sleep(Duration::from_millis(200));
        self.call("Input.dispatchTouchEvent", json!({ "type": "touchEnd", "touchPoints": [] }));
    }

    /// Lets the page see a screen that is touched.
    pub fn emulate_touch(&mut self) {
        self.call("Emulation.setTouchEmulationEnabled", json!({ "enabled": true, "maxTouchPoints": 2 }));
    }

    /// Turns the wheel over a point.
    pub fn wheel(&mut self, [x, y]: [f64; 2], down: f64) {
        let event = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": down });
        self.call("Input.dispatchMouseEvent", event);
    }

    pub fn hover(&mut self, [x, y]: [f64; 2]) {
        self.call("Input.dispatchMouseEvent", json!({ "type": "mouseMoved", "x": x, "y": y }));
    }

    /// Clicks the middle of an element.
    pub fn click(&mut self, selector: &str) {
        let middle = self.middle(selector);
        self.drag(&[middle]);
    }

    /// Scrolls to an element; returns its middle.
    fn middle(&mut self, selector: &str) -> [f64; 2] {
        let middle = self.value(&format!(
            "(() => {{ const e = document.querySelector({selector:?}); e.scrollIntoView({{ block: 'center' }}); \
             const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
        ));
        [0, 1].map(|k| middle[k].as_f64().expect("an element that is there"))
    }

    /// Writes what is seen to a PNG.
    pub fn screenshot(&mut self, path: &Path) {
        let shot = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        let text = shot["data"].as_str().expect("an image");
        std::fs::write(path, from_base64(text)).expect("a file that can be written");
    }
}

fn from_base64(text: &str) -> Vec<u8> {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for digit in text.bytes().filter_map(|c| DIGITS.iter().position(|d| *d == c)) {
        bits = bits << 6 | digit as u32;
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    bytes
}
