//! Where the image is, and what it looks like.

use std::path::Path;
use std::process::{Command, Stdio};

use super::*;
use crate::browser::chromium;
use crate::process::first_line;

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
        page.drag(&[middle, middle]);
        page.wait("document.getElementById('values').textContent.includes('albedo')");
        assert_eq!(on_image(&mut page, [0.0, 0.0]), middle, "{size:?}");
    }
}

/// A pixel without samples shows its neighbour's colour, but not as a value of its own.
#[test]
fn a_pixel_without_samples_has_no_values() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "1"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait("window.prpf && window.prpf.state.status");
    let mut shown = |samples: u32, raw: &str| {
        page.value(&format!(
            "import('/inspector.js').then(({{ showValues }}) => {{ \
             showValues([3, 4], 'raw', [0.5, 0.5, 0.5], {{ x: 3, y: 4, samples: {samples}, raw: {raw}, filtered: null, \
             variance: null, error: null, residual: null, failure: null, albedo: null, normal: null }}); \
             return document.getElementById('values').textContent; }})"
        ))
    };
    assert_eq!(shown(0, "null"), "pixel3, 4samples0");
    assert_eq!(shown(2, "[1, 1, 1]"), "pixel3, 4unfiltered1.000  1.000  1.000samples2");
}

/// The image of a moved camera is filtered at a lower resolution long before every pixel has samples.
#[test]
fn a_large_image_is_filtered_coarsely_first() {
    let Some(program) = chromium() else { return };
    let arguments = ["--resolution", "1920x1080", "--threads", "1", "--spp", "0", "--max-spp", "100000"];
    let (_render, address, _folder) = preview(&arguments);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait("window.prpf && window.prpf.state.status && window.prpf.viewport.frames.size > 0");
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.1, 0.05]));
    page.drag(&[from, to]);
    let badge = "document.getElementById('badge')";
    page.wait(&format!(
        "{GENERATION} > 1 && /^filtered at \\d+×\\d+ so far$/.test({badge}.textContent) && !{badge}.hidden"
    ));
    let filtered =
        page.value("(({ width, side }) => [width, side > 1])(window.prpf.viewport.frames.get('filtered'))");
    assert_eq!(filtered, serde_json::json!([1920, true]));
    // So are its maps
    for view in ["error", "failure"] {
        page.click(&format!("input[name=view][value={view}]"));
        page.wait(&format!("window.prpf.viewport.frames.get('{view}')?.generation > 1"));
        assert_eq!(page.value(&format!("window.prpf.viewport.frames.get('{view}').side > 1")), true);
    }
    assert!(page.value("window.prpf.state.status.statistics.mean").as_f64().unwrap() < 2.0);
}

/// A finished render sends no image again.
#[test]
fn the_image_survives_a_lost_context_and_a_small_graphics_card() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "4"]);
    let mut page = Page::open(program, &address, [900, 600]);
    page.wait("window.prpf && window.prpf.viewport.frames.has('filtered')");
    page.wait(&format!("{PHASE} === 'finished'"));
    page.value(
        "window.loss = window.prpf.viewport.gl.getExtension('WEBGL_lose_context'); window.loss.loseContext()",
    );
    page.wait("document.getElementById('notices').textContent.includes('has lost the graphics context')");
    page.value("window.loss.restoreContext()");
    page.wait("!window.prpf.viewport.gl.isContextLost()");
    assert!(brightness(&mut page) > 1.0);

    // The image of 96×64 pixels as on a card that takes 32
    page.value("(({ viewport }) => { viewport.largest = 32; viewport.setFrame('filtered', viewport.frames.get('filtered')); })(window.prpf)");
    page.wait("document.getElementById('notices').textContent.includes('32×22 of this one')");
    assert!(brightness(&mut page) > 1.0);
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
