//! Tests the live page in a real browser: it loads, shows the image as it converges, and steers the render.
//!
//! Without Chromium these tests print so and pass. `PRPF_SCREENSHOTS=FOLDER` saves screenshots.

mod browser;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tungstenite::Message;

use browser::{Page, Running, chromium, first_line};

const SCENE: &str = r#"
LookAt 0 1.5 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Integrator "path" "integer maxdepth" 3
Film "rgb" "integer xresolution" 96 "integer yresolution" 64 "string filename" "named.exr"
WorldBegin
LightSource "infinite" "rgb L" [ 0.2 0.25 0.3 ]
AttributeBegin
AreaLightSource "diffuse" "rgb L" [ 6 5 4 ]
Translate 2 3 -1
Shape "sphere" "float radius" 0.5
AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.7 0.2 0.2 ]
Shape "sphere" "float radius" 1
Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
Shape "trianglemesh" "point3 P" [ -9 -1 -9  9 -1 -9  9 -1 9  -9 -1 9 ] "integer indices" [ 0 1 2 0 2 3 ]
"#;

/// Starts a preview in a folder of its own; returns its URL as well.
fn preview(arguments: &[&str]) -> (Running, String, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).expect("a file in it");
    let mut program = Command::new(env!("CARGO_BIN_EXE_prpf"))
        .current_dir(folder.path())
        .args(["preview", "scene.pbrt"])
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .map(Running)
        .expect("the program starts");
    let output = program.0.stdout.take().expect("it was asked for");
    let address = first_line(output, |line| line.strip_prefix("preview at ").map(str::to_owned));
    (program, address.expect("the program says where the page is"), folder)
}

fn screenshots() -> Option<PathBuf> {
    std::env::var_os("PRPF_SCREENSHOTS").map(PathBuf::from)
}

fn save_screenshot(page: &mut Page, name: &str) {
    if let Some(folder) = screenshots() {
        page.screenshot(&folder.join(name));
    }
}

/// Returns the page coordinates of the image's middle, shifted by fractions of the image's size.
fn on_image(page: &mut Page, [x, y]: [f64; 2]) -> [f64; 2] {
    let place = page.value(&format!(
        "(() => {{ const p = window.prpf.viewport, b = p.canvas.getBoundingClientRect(); \
         const at = p.toCanvas(p.size[0] * (0.5 + {x}), p.size[1] * (0.5 + {y})); \
         return [b.x + at[0], b.y + at[1]]; }})()"
    ));
    [0, 1].map(|k| place[k].as_f64().expect("a number"))
}

fn brightness(page: &mut Page) -> f64 {
    let sum = "window.prpf.viewport.redraw().then(() => { const p = window.prpf.viewport, gl = p.gl, w = gl.drawingBufferWidth, h = gl.drawingBufferHeight; \
         const data = new Uint8Array(4 * w * h); gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data); \
         return data.reduce((a, b, i) => i % 4 < 3 ? a + b : a, 0) / (w * h); })";
    page.value(sum).as_f64().expect("a number")
}

const SAMPLES: &str = "window.prpf.state.status.statistics.samples";
const PHASE: &str = "window.prpf.state.status.phase";

#[test]
fn the_page_shows_and_steers_a_render() {
    let Some(program) = chromium() else { return };
    let (_render, address, folder) = preview(&["--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, &address, [1600, 1000]);

    // The page loads, and an image is on it, raw first, then filtered.
    page.wait("window.prpf && window.prpf.viewport.frames.size > 0");
    page.wait("window.prpf.viewport.frames.has('filtered')");
    page.wait("window.prpf.viewport.shown.right === 'filtered'");
    page.wait("window.prpf.viewport.drawn > 0");
    assert!(brightness(&mut page) > 1.0, "the graphics card shows something");

    // The image changes as samples come.
    page.key("2");
    page.wait("window.prpf.viewport.shown.right === 'raw' && window.prpf.viewport.frames.has('raw')");
    let before = page.value("window.prpf.viewport.frames.get('raw').sequence");
    let samples = page.value(SAMPLES);
    page.wait(&format!("window.prpf.viewport.frames.get('raw').sequence > {before}"));
    page.wait(&format!("{SAMPLES} > {samples}"));

    // Another view: sample counts, with a legend in their unit.
    page.click("input[value=samples]");
    page.wait("window.prpf.viewport.frames.has('samples')");
    page.wait("!document.getElementById('legend').hidden");
    let unit = page.value("document.querySelector('#legend p').textContent");
    assert_eq!(unit, "samples per pixel");

    for view in ["error", "variance", "residual", "failure", "albedo", "normal"] {
        page.click(&format!("input[name=view][value={view}]"));
        page.wait(&format!("window.prpf.viewport.shown.right === '{view}'"));
        page.wait(&format!("window.prpf.viewport.frames.has('{view}')"));
    }
    page.click("input[value=samples]");
    page.wait("window.prpf.viewport.shown.right === 'samples'");

    // Statistics, and the forecast of the error.
    page.wait("window.prpf.state.status.curve.length > 0 && window.prpf.state.status.forecast");
    page.wait("document.getElementById('forecast').textContent.startsWith('Halving the error takes')");
    page.wait("[...document.querySelectorAll('[data-value]')].every((dd) => dd.textContent !== '–')");

    // Values under the cursor.
    let middle = on_image(&mut page, [0.0, 0.0]);
    page.hover(middle);
    page.wait("window.prpf.state.values && window.prpf.state.values.samples > 0");
    page.wait("document.getElementById('values').textContent.includes('unfiltered')");

    // The exposure brightens what is shown without a new image.
    page.key("2");
    page.key(" ");
    page.wait(&format!("{PHASE} === 'paused'"));
    page.wait("window.prpf.viewport.shown.right === 'raw'");
    let dark = brightness(&mut page);
    page.key("e");
    assert!(brightness(&mut page) > dark * 1.02);

    // A pause: no more samples. Then it goes on.
    let samples = page.value(SAMPLES);
    std::thread::sleep(std::time::Duration::from_millis(600));
    assert_eq!(page.value(SAMPLES), samples);
    page.key(" ");
    page.wait(&format!("{SAMPLES} > {samples}"));

    // The camera follows the pointer, and a new image appears.
    let generation = page.value("window.prpf.state.status.generation");
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.2, 0.1]));
    page.drag(&[from, [(from[0] + to[0]) / 2.0, from[1]], to]);
    page.wait(&format!("window.prpf.viewport.frames.get('raw').generation > {generation}"));

    // A click sets the focus: the sphere is nearer than the floor behind it.
    page.key("f");
    page.click("#aperture");
    page.value("document.getElementById('aperture').value = '0.1'; document.getElementById('aperture').dispatchEvent(new Event('change'))");
    page.wait("window.prpf.state.status.camera.aperture > 0.09");
    let at = on_image(&mut page, [0.0, 0.0]);
    page.drag(&[at]);
    page.wait("window.prpf.state.status.camera.focus < 3.6");
    let near = page.value("window.prpf.state.status.camera.focus").as_f64().unwrap();
    let behind = on_image(&mut page, [0.45, -0.05]);
    page.drag(&[behind]);
    page.wait(&format!("window.prpf.state.status.camera.focus > {}", near + 0.5));

    // A priority region is rendered first.
    page.key("r");
    let (from, to) = (on_image(&mut page, [-0.2, -0.2]), on_image(&mut page, [0.0, 0.0]));
    page.drag(&[from, to]);
    page.wait("window.prpf.state.status.region");
    page.wait("window.prpf.state.status.statistics.max > 4 * window.prpf.state.status.statistics.min");
    page.key("Escape");
    page.wait("!window.prpf.state.status.region");

    // Settings: denoiser off and on again.
    page.click("input[name=denoiser][value=none]");
    page.wait("window.prpf.state.status.settings.denoiser === 'none'");
    page.click("input[value=uniform]");
    page.wait("window.prpf.state.status.settings.sampling === 'uniform'");

    // A save.
    page.click("#save");
    page.wait("window.prpf.state.status.notices.some((n) => n.text.startsWith('saved'))");
    for name in ["named-0001.exr", "named-0001.png"] {
        assert!(folder.path().join(name).metadata().unwrap().len() > 100, "{name}");
    }

    // A restart forgets all samples.
    let generation = page.value("window.prpf.state.status.generation");
    page.click("#restart");
    page.wait(&format!("window.prpf.state.status.generation > {generation}"));

    // A budget that is spent ends it.
    page.value("document.getElementById('spp').value = '4'; document.getElementById('spp').dispatchEvent(new Event('change'))");
    page.wait(&format!("{PHASE} === 'finished'"));
    save_screenshot(&mut page, "wide.png");
    page.resize([420, 900]);
    page.wait("window.prpf.viewport.canvas.clientWidth <= 420");
    let overflow = page.value("document.documentElement.scrollWidth");
    assert!(overflow.as_f64().unwrap() <= 420.0, "{overflow}");
    save_screenshot(&mut page, "narrow.png");
}

/// Starts a preview without a budget, in a page that has its first image and records what it sends.
fn recording_page(program: &str, size: [u32; 2]) -> (Page, Running, tempfile::TempDir) {
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
fn sent(page: &mut Page, kind: &str) -> u64 {
    let count = page.value(&format!("window.sent.filter(({{ type }}) => type === '{kind}').length"));
    count.as_u64().expect("a count")
}

const GENERATION: &str = "window.prpf.state.status.generation";
const STOPS: &str = "document.getElementById('stops').textContent";
const TOOL: &str = "window.prpf.viewport.canvas.dataset.tool";

#[test]
fn the_interpolation_map_is_made_for_a_viewer_whatever_the_denoiser() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "8", "--denoiser", "none", "--sampling", "uniform"]);
    let mut page = Page::open(program, &address, [900, 600]);
    page.wait("window.prpf && window.prpf.state.status?.phase === 'finished'");
    page.click("input[name=view][value=residual]");
    page.wait(
        "window.prpf.viewport.frames.has('residual') && window.prpf.viewport.shown.right === 'residual'",
    );
    page.click("input[name=view][value=failure]");
    page.wait("window.prpf.viewport.frames.has('failure') && window.prpf.viewport.shown.right === 'failure'");
    page.wait("window.prpf.state.status.phase === 'finished'");
}

#[test]
fn a_map_of_the_old_camera_is_not_shown_after_a_movement() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, &address, [900, 600]);
    page.wait("window.prpf && window.prpf.state.status");
    page.click("input[name=view][value=error]");
    page.wait("window.prpf.viewport.frames.has('error') && window.prpf.viewport.shown.right === 'error'");
    // While paused without a denoiser, nothing makes such a map of the new image.
    page.click("input[name=denoiser][value=none]");
    page.wait("window.prpf.state.status.settings.denoiser === 'none'");
    page.click("#pause");
    page.wait(&format!("{PHASE} === 'paused'"));
    let generation = page.value(GENERATION);
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.1, 0.0]));
    page.drag(&[from, to]);
    page.wait(&format!("{GENERATION} > {generation} && {PHASE} === 'paused'"));
    page.wait("window.prpf.viewport.shown.right === 'raw' && window.prpf.viewport.frames.has('raw')");
}

#[test]
fn keys_select_views_and_tools() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);

    let views = page.value("window.prpf.state.status.views.map(({ view }) => view)");
    for (i, view) in views.as_array().expect("a list").iter().enumerate().rev() {
        page.key(&(i + 1).to_string());
        assert_eq!(page.value("window.prpf.state.view"), *view);
        assert_eq!(page.value("document.querySelector('input[name=view]:checked').value"), *view);
    }
    for (key, tool) in [("c", "camera"), ("f", "focus"), ("r", "region"), ("q", "inspect")] {
        page.key(key);
        assert_eq!(page.value(TOOL), tool);
        assert_eq!(page.value("document.querySelector('input[name=tool]:checked').value"), tool);
    }

    page.key("w");
    page.wait("!document.getElementById('wipe').hidden && window.prpf.viewport.shown.left === 'raw'");
    page.key(".");
    assert_eq!(page.value("window.prpf.viewport.wipe.toFixed(2)"), "0.55");
    page.key("w");
    page.wait("document.getElementById('wipe').hidden && window.prpf.viewport.wipe === null");
    page.key("e");
    assert_eq!(page.value(STOPS), "+0.3");
    page.shift_key("E");
    assert_eq!(page.value(STOPS), "0.0");

    // With Caps Lock the letters are capitals, but only Shift makes other commands of them.
    page.key("S");
    assert_eq!((sent(&mut page, "save"), sent(&mut page, "restart")), (1, 0));
    page.key("R");
    assert_eq!((page.value(TOOL), sent(&mut page, "restart")), ("region".into(), 0));
    page.key("E");
    assert_eq!(page.value(STOPS), "+0.3");
    page.shift_key("r");
    assert_eq!(sent(&mut page, "restart"), 1);
}

#[test]
fn space_pauses_unless_a_button_has_the_focus() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);
    page.key(" ");
    page.wait(&format!("{PHASE} === 'paused'"));
    page.value("document.getElementById('pause').focus()");
    page.key(" ");
    page.wait(&format!("{PHASE} !== 'paused'"));
    assert_eq!(sent(&mut page, "pause"), 2, "once each time");
    page.value("document.getElementById('save').focus()");
    page.key(" ");
    assert_eq!((sent(&mut page, "save"), sent(&mut page, "pause")), (1, 2));
}

#[test]
fn the_home_key_resets_the_camera_except_in_a_field() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);
    page.value(
        "const field = document.getElementById('aperture'); field.focus(); \
         field.value = '0.1'; field.dispatchEvent(new Event('change'))",
    );
    page.wait("window.prpf.state.status.camera.aperture > 0.09");
    page.key("Home");
    assert_eq!(sent(&mut page, "camera"), 1, "in a field it moves the caret");
    let generation = page.value(GENERATION);
    page.value("window.prpf.viewport.canvas.focus()");
    page.key("Home");
    page.wait(&format!("{GENERATION} > {generation} && window.prpf.state.status.camera.aperture === 0"));
    // What does not move the camera loses no sample.
    let generation = page.value(GENERATION);
    page.key("Home");
    page.wait("window.prpf.state.status.statistics.mean > 8");
    assert_eq!((page.value(GENERATION), sent(&mut page, "camera")), (generation, 3));
}

#[test]
fn two_fingers_move_the_image_or_the_camera() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [812, 375]);
    let [x, y] = on_image(&mut page, [0.0, 0.0]);
    let apart = |half: f64, down: f64| [[x - half, y + down], [x + half, y + down]];
    let double_and_lower = [apart(50.0, 0.0), apart(75.0, 10.0), apart(100.0, 30.0)];

    // The point between the fingers stays between them.
    let zoom = page.value("window.prpf.viewport.zoom").as_f64().expect("a number");
    page.pinch(&double_and_lower);
    let doubled = page.value("window.prpf.viewport.zoom").as_f64().expect("a number");
    assert!((doubled / zoom - 2.0).abs() < 1e-6, "{zoom} {doubled}");
    let [now_x, now_y] = on_image(&mut page, [0.0, 0.0]);
    assert!((now_x - x).abs() < 1e-6 && (now_y - y - 30.0).abs() < 1e-6, "{now_x} {now_y}");

    // Fingers that do not move make neither a click nor a region.
    for tool in ["f", "r"] {
        page.key(tool);
        page.pinch(&[apart(50.0, 0.0)]);
    }
    assert_eq!((sent(&mut page, "camera"), sent(&mut page, "priority-region")), (0, 0));
    assert_eq!(page.value("window.prpf.state.isPinned"), false);
    assert_eq!(page.value("document.getElementById('region').hidden"), true);

    page.key("0");
    page.key("c");
    let (zoom, generation) = (page.value("window.prpf.viewport.zoom"), page.value(GENERATION));
    page.pinch(&double_and_lower);
    page.wait(&format!("{GENERATION} > {generation}"));
    assert_eq!(page.value("window.prpf.viewport.zoom"), zoom);
    page.wait(
        "(() => { const p = window.prpf.viewport, sum = (f) => window.sent.reduce((a, m) => a + f(m), 0); \
         const down = sum((m) => m.pan?.[1] ?? 0) * p.size[1] * p.zoom; \
         return Math.abs(sum((m) => m.dolly ?? 0) - Math.LN2) < 1e-6 && Math.abs(down - 30) < 1e-6; })()",
    );
    save_screenshot(&mut page, "low.png");
}

#[test]
fn the_mouse_pans_and_dollies_the_camera_or_moves_the_image() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1024, 768]);
    let middle = on_image(&mut page, [0.0, 0.0]);
    let to = [middle[0] + 40.0, middle[1] - 30.0];
    // In image heights.
    let sums = |page: &mut Page| {
        let sums = page.value(
            "(() => { const p = window.prpf.viewport, h = p.size[1] * p.zoom; \
             const sum = (f) => window.sent.reduce((a, m) => a + f(m), 0); \
             return [sum((m) => m.pan?.[0] ?? 0) * h, sum((m) => m.pan?.[1] ?? 0) * h, \
               sum((m) => m.dolly ?? 0) * h, sum((m) => m.orbit ? 1 : 0)]; })()",
        );
        [0, 1, 2, 3].map(|k| sums[k].as_f64().expect("a sum").round() as i32)
    };
    let moved = |page: &mut Page, sums_expected: [i32; 4]| {
        let started = std::time::Instant::now();
        while sums(page) != sums_expected {
            assert!(started.elapsed().as_secs() < 20, "{:?} for {sums_expected:?}", sums(page));
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    };
    page.key("c");
    page.drag_with(8, &[middle, to]);
    moved(&mut page, [40, -30, 0, 0]);
    page.drag_with(2, &[middle, to]);
    moved(&mut page, [40, -30, 30, 0]);
    let generation = page.value(GENERATION);
    page.wheel(middle, -100.0);
    page.wait("window.sent.filter((m) => m.dolly).length === 2");
    page.wait(&format!("{GENERATION} > {generation}"));

    page.key("q");
    let zoom = page.value("window.prpf.viewport.zoom").as_f64().expect("a number");
    // The point of the image under the pointer, before and after the page handles the event.
    page.value(
        "(() => { window.under = []; const note = (e) => { const p = window.prpf.viewport, \
         b = p.canvas.getBoundingClientRect(); window.under.push([(e.clientX - b.x - p.corner[0]) / p.zoom, \
         (e.clientY - b.y - p.corner[1]) / p.zoom]); }; \
         addEventListener('wheel', note, { capture: true }); addEventListener('wheel', note); return 0; })()",
    );
    page.wheel(middle, -100.0);
    page.wait(&format!("window.prpf.viewport.zoom > {zoom} && window.under.length === 2"));
    page.wait("[0, 1].every((k) => Math.abs(window.under[0][k] - window.under[1][k]) < 1e-6)");
    assert_eq!(page.value("window.sent.filter((m) => m.dolly).length"), 2);
}

#[test]
fn on_a_phone_in_landscape_the_image_is_beside_the_controls() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [812, 375]);
    for size in [[812, 375], [667, 375]] {
        page.resize(size);
        page.wait(&format!(
            "innerWidth === {} && document.documentElement.scrollWidth <= innerWidth",
            size[0]
        ));
        let seen = page.value(
            "(() => { const box = (s) => document.querySelector(s).getBoundingClientRect(); \
             const image = box('#image-area'), panel = box('aside'); \
             return image.height > 0.9 * innerHeight && image.width > 0.55 * innerWidth \
               && panel.left >= image.right && panel.height > 0.7 * innerHeight; })()",
        );
        assert_eq!(seen, true, "{size:?}");
    }
}

/// The pointer hits the pixel that it was aimed at.
#[test]
fn the_image_does_not_move_when_the_pointer_arrives() {
    let Some(program) = chromium() else { return };
    for size in [[390, 844], [812, 375], [1024, 768], [1600, 1000]] {
        let (mut page, _render, _folder) = recording_page(program, size);
        let middle = on_image(&mut page, [0.0, 0.0]);
        page.drag_with(0, &[middle, middle]);
        page.wait("document.getElementById('values').textContent.includes('albedo')");
        assert_eq!(on_image(&mut page, [0.0, 0.0]), middle, "{size:?}");
    }
}

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

type Socket = tungstenite::WebSocket<tungstenite::stream::MaybeTlsStream<std::net::TcpStream>>;

/// Connects a viewer without a browser.
fn viewer(address: &str) -> Socket {
    use tungstenite::client::IntoClientRequest;
    let own = address.trim_end_matches('/');
    let mut request = own.replace("http", "ws").into_client_request().unwrap();
    *request.uri_mut() = format!("{}/live", own.replace("http", "ws")).parse().unwrap();
    request.headers_mut().insert("Origin", own.parse().unwrap());
    tungstenite::connect(request).expect("a socket").0
}

fn send(socket: &mut Socket, message: &str) {
    socket.send(Message::text(message)).expect("an open socket");
}

/// Reads until the status says that the render has finished, and takes all images; returns their number.
fn watch_to_the_end(socket: &mut Socket) -> u32 {
    let mut images = 0;
    loop {
        match socket.read().expect("an open socket") {
            Message::Binary(_) => {
                images += 1;
                send(socket, r#"{"type":"ready"}"#);
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

#[test]
fn screenshots_of_another_scene() {
    let (Some(program), Some(folder), Some(scene)) =
        (chromium(), screenshots(), std::env::var_os("PRPF_SCENE"))
    else {
        return;
    };
    let mut render = Command::new(env!("CARGO_BIN_EXE_prpf"))
        .args(["preview", &scene.to_string_lossy(), "--spp", "64"])
        .stdout(Stdio::piped())
        .spawn()
        .map(Running)
        .unwrap();
    let address = first_line(render.0.stdout.take().unwrap(), |line| {
        line.strip_prefix("preview at ").map(str::to_owned)
    });
    let mut page = Page::open(program, &address.unwrap(), [1600, 1000]);
    page.wait("window.prpf && window.prpf.viewport.frames.size > 0");
    page.screenshot(&Path::new(&folder).join("preview-wide-first.png"));
    page.wait("window.prpf.viewport.frames.has('filtered')");
    page.key("w");
    page.wait("window.prpf.state.status.curve.length > 0");
    let at = on_image(&mut page, [0.1, 0.1]);
    page.hover(at);
    page.wait("window.prpf.state.values");
    let shot = |page: &mut Page, name: &str| page.screenshot(&Path::new(&folder).join(name));
    shot(&mut page, "preview-wide-wipe.png");
    page.key("w");
    page.key("3");
    page.wait("window.prpf.viewport.shown.right === 'samples' && window.prpf.viewport.frames.has('samples')");
    std::thread::sleep(std::time::Duration::from_millis(500));
    shot(&mut page, "preview-wide-samples.png");
    page.key("4");
    page.wait("window.prpf.viewport.frames.has('error')");
    std::thread::sleep(std::time::Duration::from_millis(500));
    shot(&mut page, "preview-wide-error.png");
    page.resize([420, 900]);
    page.key("1");
    std::thread::sleep(std::time::Duration::from_millis(700));
    shot(&mut page, "preview-narrow.png");
}
