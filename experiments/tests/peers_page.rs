//! Tests the page of a comparison in a real browser: dragging, zoom, and what stays when the scene changes.
//!
//! Without Chromium this test prints so and passes. `PRPF_SCREENSHOTS=FOLDER` saves a screenshot.

#[path = "../../tests/browser/mod.rs"]
#[allow(dead_code, reason = "the live page's tests use more of it")]
mod browser;
#[path = "../../tests/process/mod.rs"]
mod process;

use std::path::Path;
use std::process::Command;

use browser::{Page, chromium};
use prpf::image::{Planes, png_file};

const WIDTH: usize = 40;
const HEIGHT: usize = 20;

/// Writes a gradient of this brightness.
fn write_image(path: &Path, brightness: f32) {
    let mut planes = Planes::new(WIDTH, HEIGHT, 3);
    for plane in planes.planes_mut() {
        let values = plane.iter_mut().enumerate();
        values.for_each(|(i, value)| *value = brightness * (i % WIDTH) as f32 / WIDTH as f32);
    }
    png_file::write(path, &planes, 0.0).expect("an image that can be written");
}

/// Opens the page of two scenes with two images each.
fn open(program: &str, folder: &Path) -> Page {
    for scene in ["one", "two"] {
        let scene = folder.join(scene);
        std::fs::create_dir(&scene).expect("a folder");
        for (name, brightness) in [("reference", 0.5), ("bright", 0.7), ("dark", 0.3)] {
            write_image(&scene.join(format!("{name}.png")), brightness);
        }
    }
    let made = Command::new(env!("CARGO_BIN_EXE_prpf-experiments")).arg("peers").arg(folder).status();
    assert!(made.expect("the program runs").success());
    let address = format!("file://{}", folder.join("peers.html").display());
    let mut page = Page::open(program, &address, [1000, 700]);
    page.wait("document.readyState === 'complete' && [...decoded.values()].every((image) => image.complete)");
    page
}

fn number(page: &mut Page, expression: &str) -> f64 {
    page.value(expression).as_f64().expect("a number")
}

/// Returns the middle of the image in the picture, and pixels of the page per pixel of the image.
fn position(page: &mut Page) -> [f64; 3] {
    ["state.x", "state.y", "state.zoom ?? fitZoom()"].map(|expression| number(page, expression))
}

#[test]
fn the_page_is_dragged_and_zoomed() {
    let Some(program) = chromium() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut page = open(program, folder.path());
    let is_drawn = "(() => { const c = canvas.getContext('2d').getImageData(canvas.width / 4, canvas.height / 2, 1, 1).data; return c[0] > 0; })()";
    page.wait(is_drawn);
    let middle = ["left + b.width / 4", "top + b.height / 2"].map(|at| {
        number(
            &mut page,
            &format!("(() => {{ const b = canvas.getBoundingClientRect(); return b.{at}; }})()"),
        )
    });
    let [x, y] = middle;

    // The picture follows the mouse as often as it is dragged, and only then
    let [before_x, before_y, zoom] = position(&mut page);
    for _ in 0..3 {
        page.drag(&[middle, [x + 10.0, y + 10.0], [x + 30.0, y + 20.0]]);
        page.hover([x - 50.0, y - 50.0]);
    }
    let [dragged_x, dragged_y, same_zoom] = position(&mut page);
    let expected = [before_x - 90.0 / zoom / WIDTH as f64, before_y - 60.0 / zoom / HEIGHT as f64];
    assert!((dragged_x - expected[0]).abs() < 1e-6 && (dragged_y - expected[1]).abs() < 1e-6);
    assert_eq!(zoom, same_zoom);
    page.drag_with("right", 0, &[middle, [x + 30.0, y + 20.0]]);
    page.hover([x - 50.0, y - 50.0]);
    assert_eq!(position(&mut page), [dragged_x, dragged_y, zoom], "the right button does nothing");

    // So does the split, which leaves the picture where it is
    let line = number(&mut page, "(b => b.left + b.width / 2)($('#split').getBoundingClientRect())");
    page.drag(&[[line, y], [line - 50.0, y], [x, y]]);
    assert!((number(&mut page, "state.split") - 0.25).abs() < 0.01);
    page.drag_with("right", 0, &[[x, y], [x + 100.0, y]]);
    page.hover([x + 200.0, y]);
    assert!((number(&mut page, "state.split") - 0.25).abs() < 0.01);
    assert_eq!(position(&mut page), [dragged_x, dragged_y, zoom]);
    page.drag(&[[x, y], [-100.0, y]]);
    assert_eq!(number(&mut page, "state.split"), 0.0, "not beyond the picture");
    page.value("setSplit(0.5); draw(); 0");

    // A touch drags as well
    page.pinch(&[[middle, [x, y + 60.0]], [[x + 30.0, y], [x, y + 60.0]], [[x + 60.0, y], [x, y + 60.0]]]);
    assert!(position(&mut page)[0] < dragged_x, "the first finger drags");

    // The wheel keeps what is under the mouse, and another scene and another map keep the place
    let under = "((p) => { const z = state.zoom ?? fitZoom(), b = canvas.getBoundingClientRect(); \
                 return state.x + (p - b.left - b.width / 2) / z / 40; })";
    let before = number(&mut page, &format!("{under}({x})"));
    page.wheel(middle, -400.0);
    page.wait(&format!("Math.abs((state.zoom ?? fitZoom()) - {zoom}) > 1"));
    assert!((number(&mut page, &format!("{under}({x})")) - before).abs() < 1e-6);
    let place = position(&mut page);
    page.value("$('#scene').value = 1; $('#scene').onchange({ target: $('#scene') }); $('#map').value = 'flip_map'; draw(); 0");
    assert_eq!(position(&mut page), place);
    assert_eq!(number(&mut page, "state.scene"), 1.0);
    page.click("#fit");
    assert_eq!(position(&mut page), [0.5, 0.5, zoom]);
    if let Some(folder) = std::env::var_os("PRPF_SCREENSHOTS") {
        page.screenshot(&Path::new(&folder).join("peers.png"));
    }
}
