//! Tests of the live page by subject, and what they share.

mod camera;
mod comparison;
mod connection;
mod history;
mod image;
mod keyboard;
mod phone;
mod scenes;
mod steering;

use std::path::PathBuf;

use crate::browser::Page;
use crate::live::preview;
use crate::process::Running;

pub fn screenshots() -> Option<PathBuf> {
    std::env::var_os("PRPF_SCREENSHOTS").map(PathBuf::from)
}

pub fn save_screenshot(page: &mut Page, name: &str) {
    if let Some(folder) = screenshots() {
        page.screenshot(&folder.join(name));
    }
}

/// Returns the page coordinates of the image's middle, shifted by fractions of the image's size.
pub fn on_image(page: &mut Page, [x, y]: [f64; 2]) -> [f64; 2] {
    let place = page.value(&format!(
        "(() => {{ const p = window.prpf.viewport, b = p.canvas.getBoundingClientRect(); \
         const at = p.toCanvas(p.size[0] * (0.5 + {x}), p.size[1] * (0.5 + {y})); \
         return [b.x + at[0], b.y + at[1]]; }})()"
    ));
    [0, 1].map(|k| place[k].as_f64().expect("a number"))
}

pub fn brightness(page: &mut Page) -> f64 {
    let sum = "window.prpf.viewport.redraw().then(() => { const p = window.prpf.viewport, gl = p.gl, w = gl.drawingBufferWidth, h = gl.drawingBufferHeight; \
         const data = new Uint8Array(4 * w * h); gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data); \
         return data.reduce((a, b, i) => i % 4 < 3 ? a + b : a, 0) / (w * h); })";
    page.value(sum).as_f64().expect("a number")
}

/// Enters a number in a field.
pub fn enter(page: &mut Page, field: &str, text: &str) {
    page.value(&format!(
        "(() => {{ const field = document.getElementById('{field}'); field.focus(); field.value = '{text}'; \
         field.dispatchEvent(new Event('change')); field.blur(); return 0; }})()"
    ));
}

pub const SAMPLES: &str = "window.prpf.state.status.statistics.samples";
pub const PHASE: &str = "window.prpf.state.status.phase";

/// Starts a preview without a budget, in a page that has its first image and records what it sends.
pub fn recording_page(program: &str, size: [u32; 2]) -> (Page, Running, tempfile::TempDir) {
    let (render, address, folder) = preview(&["--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, &address, size);
    page.wait("window.prpf && window.prpf.state.status && window.prpf.viewport.frames.size > 0");
    page.value(
        "window.sent = []; const send = WebSocket.prototype.send; WebSocket.prototype.send = \
         function (text) { window.sent.push(JSON.parse(text)); send.call(this, text); }; 0",
    );
    (page, render, folder)
}

/// Returns how often the page has sent a message of a type.
pub fn sent(page: &mut Page, kind: &str) -> u64 {
    let count = page.value(&format!("window.sent.filter(({{ type }}) => type === '{kind}').length"));
    count.as_u64().expect("a count")
}

pub const GENERATION: &str = "window.prpf.state.status.generation";
pub const STOPS: &str = "document.getElementById('stops').textContent";
pub const TOOL: &str = "window.prpf.viewport.canvas.dataset.tool";
