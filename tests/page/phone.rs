//! A session with fingers alone, on a screen of a phone's size.

use super::*;
use crate::browser::chromium;

const ZOOM: &str = "window.prpf.viewport.zoom";

#[test]
fn a_phone_steers_a_render_by_touch() {
    let Some(program) = chromium() else { return };
    let (render, address, folder) = preview(&["--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, "about:blank", [390, 844]);
    page.emulate_touch();
    page.go_to(&address);
    page.wait("window.prpf && window.prpf.state.status && window.prpf.viewport.frames.size > 0");
    let width = page.value("document.documentElement.scrollWidth").as_f64().expect("a width");
    assert!(width <= 390.0, "nothing to scroll to the side: {width}");
    page.wait("matchMedia('(pointer: coarse)').matches");

    // Two fingers zoom, a button fits the image again
    let [x, y] = on_image(&mut page, [0.0, 0.0]);
    let apart = |half: f64| [[x - half, y], [x + half, y]];
    let fitted = page.value(ZOOM);
    page.pinch(&[apart(30.0), apart(45.0), apart(60.0)]);
    page.wait(&format!("{ZOOM} > 1.9 * {fitted}"));
    page.tap("#fit");
    page.wait(&format!("{ZOOM} === {fitted}"));

    // A finger pins a pixel, and lets go of it
    page.tap_at([x, y]);
    page.wait("window.prpf.state.isPinned && window.prpf.state.values");

    // It marks a region and clears it
    page.tap("#tools input[value=region] + span");
    page.wait(&format!("{TOOL} === 'region'"));
    let (from, to) = (on_image(&mut page, [-0.2, -0.2]), on_image(&mut page, [0.1, 0.1]));
    page.swipe(&[from, [x, y], to]);
    page.wait("window.prpf.state.status.region");
    save_screenshot(&mut page, "phone-region.png");
    page.tap("#clear-region");
    page.wait("!window.prpf.state.status.region");

    // It moves the camera, and takes that back
    let generation = page.value(GENERATION);
    page.tap("#tools input[value=camera] + span");
    page.wait(&format!("{TOOL} === 'camera'"));
    let to = on_image(&mut page, [0.2, 0.0]);
    page.swipe(&[[x, y], to]);
    page.wait(&format!("{GENERATION} > {generation} && {SAMPLES} > 0"));

    // The panel below is reached by scrolling, its choices and buttons by taps
    page.tap("input[name=view][value=raw] + span");
    page.wait("window.prpf.viewport.shown.right === 'raw'");
    page.tap("#pause");
    page.wait(&format!("{PHASE} === 'paused'"));
    page.tap("#pause");
    page.wait(&format!("{PHASE} !== 'paused'"));
    page.tap("#save");
    page.wait("window.prpf.state.status.notices.some((notice) => notice.text.startsWith('saved'))");
    assert!(folder.path().join("named-0001.png").exists());
    save_screenshot(&mut page, "phone.png");
    drop(render);
}
