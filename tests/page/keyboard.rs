//! A whole session with the keyboard alone.

use super::*;
use crate::browser::chromium;
use crate::live::{SCENE, folder_with_scene, start_in};

const FOCUSED: &str = "(document.activeElement.id || document.activeElement.textContent)";
const CAMERA: &str = "window.prpf.state.status.camera";

/// Moves the focus by Tab until it is on an element.
fn tab_to(page: &mut Page, wanted: &str) {
    for _ in 0..60 {
        if page.value(FOCUSED) == wanted {
            return;
        }
        page.key("Tab");
    }
    panic!("Tab does not lead to {wanted}");
}

/// Presses a key that begins a new generation.
fn begin_with(page: &mut Page, key: &str) {
    let generation = page.value(GENERATION);
    page.key(key);
    page.wait(&format!("{GENERATION} > {generation}"));
}

#[test]
fn a_session_needs_no_pointer() {
    let Some(program) = chromium() else { return };
    let folder = folder_with_scene();
    std::fs::write(folder.path().join("second.pbrt"), SCENE.replace("named.exr", "second.exr"))
        .expect("a file");
    let (_render, address) = start_in(folder.path(), "preview", &["--spp", "0", "--max-spp", "100000"]);
    let mut page = Page::open(program, &address, [900, 600]);
    page.wait("window.prpf && window.prpf.state.status && window.prpf.viewport.frames.size > 0");

    // Move the camera: the keys are the image's from the start
    page.key("c");
    for key in ["ArrowRight", "PageUp"] {
        begin_with(&mut page, key);
    }

    // Enter an aperture, and focus on a pixel
    tab_to(&mut page, "aperture");
    page.key("0");
    page.key(".");
    page.key("1");
    page.key("Enter");
    page.wait(&format!("{CAMERA}.aperture > 0.09"));
    page.key("Escape");
    page.key("f");
    assert_eq!(page.value(FOCUSED), "viewport");
    page.shift_key("ArrowDown");
    begin_with(&mut page, "Enter");
    page.wait("window.prpf.state.isPinned");

    // Mark a region by two corners; Escape gives it up, and clears it
    page.key("r");
    page.key("Enter");
    page.shift_key("ArrowRight");
    page.key("ArrowUp");
    page.wait("!document.getElementById('region').hidden");
    page.key("Escape");
    page.wait("document.getElementById('region').hidden && window.prpf.state.isPinned");
    page.key("Enter");
    page.shift_key("ArrowLeft");
    page.key("ArrowDown");
    page.key("Enter");
    page.wait("window.prpf.state.status.region");
    let [width, height] = [0, 1].map(|k| {
        let side = format!(
            "(([a, b]) => (b - a) * window.prpf.viewport.size[{k}])(window.prpf.state.status.region[{k}])"
        );
        page.value(&side).as_f64().expect("a number").round()
    });
    assert_eq!([width, height], [11.0, 2.0]);
    page.key("Escape");
    page.wait("!window.prpf.state.status.region");

    // At the edge of the image the pixel stays pinned
    for _ in 0..20 {
        page.shift_key("ArrowLeft");
    }
    assert_eq!(
        page.value("[window.prpf.state.isPinned, window.prpf.state.pixel[0]]"),
        serde_json::json!([true, 0])
    );

    // Save, and compare with what was saved: a list keeps the keys that it uses
    page.key("s");
    page.wait("[...document.querySelectorAll('#against option')].some((o) => o.value === 'save:0')");
    tab_to(&mut page, "against");
    page.key("ArrowDown");
    page.wait("document.getElementById('against').value === 'save:0'");
    page.key("Home");
    page.wait("document.getElementById('against').value === 'raw'");
    page.key("ArrowDown");
    page.key("w");
    page.wait("window.prpf.viewport.shown.left === 'save:0' && window.prpf.viewport.frames.has('save:0')");
    page.key("w");
    assert!(page.value(&format!("{CAMERA}.aperture")).as_f64() > Some(0.09), "Home was the list's");

    // Restart, and undo
    page.wait("window.prpf.state.status.statistics.seconds > 2.5");
    let samples = page.value(SAMPLES).as_u64().expect("a number");
    let generation = page.value(GENERATION);
    page.shift_key("R");
    page.wait(&format!("{GENERATION} > {generation} && !document.getElementById('undo').disabled"));
    begin_with(&mut page, "u");
    page.wait(&format!("{SAMPLES} >= {samples}"));

    // Open another scene and come back; Escape gives the focus back
    let focused = page.value(FOCUSED);
    page.key("o");
    page.wait(&format!("{FOCUSED} === 'scene.pbrt'"));
    page.key("Escape");
    assert_eq!(page.value(FOCUSED), focused);
    for name in ["second.pbrt", "scene.pbrt"] {
        page.key("o");
        page.wait("document.activeElement.closest('#scene-list')");
        tab_to(&mut page, name);
        page.key("Enter");
        page.wait(&format!(
            "window.prpf.state.status?.scene.endsWith('{name}') && window.prpf.viewport.frames.size > 0"
        ));
    }
}
