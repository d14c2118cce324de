//! Comparing: with a reference, and with saved images.

use super::*;
use crate::browser::chromium;
use crate::live::{folder_with_scene, start_in};

const SHOWN: &str = "window.prpf.viewport.shown";

fn choose(page: &mut Page, against: &str) {
    page.value(&format!(
        "(() => {{ const list = document.getElementById('against'); list.value = '{against}'; \
         list.dispatchEvent(new Event('change')); return 0; }})()"
    ));
}

#[test]
fn a_reference_has_views_and_an_error() {
    let Some(program) = chromium() else { return };
    let folder = folder_with_scene();
    let rendered = std::process::Command::new(env!("CARGO_BIN_EXE_prpf"))
        .current_dir(folder.path())
        .args(["render", "scene.pbrt", "--spp", "64", "--seed", "1", "-o", "reference.exr", "--quiet"])
        .status();
    assert!(rendered.expect("it starts").success());
    let (_render, address) =
        start_in(folder.path(), "preview", &["--spp", "16", "--reference", "reference.exr"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));
    page.wait("parseFloat(document.querySelector('[data-value=true_error]').textContent) > 0");
    for view in ["reference", "difference", "flip"] {
        page.click(&format!("input[name=view][value={view}]"));
        page.wait(&format!("{SHOWN}.right === '{view}' && window.prpf.viewport.frames.has('{view}')"));
    }
    page.wait("document.querySelector('[data-value=true_error]').textContent.includes('FLIP')");
    assert_eq!(page.value("document.querySelector('#legend p').textContent"), "visible difference (FLIP)");
    // Its value stays beside those of the render
    let middle = on_image(&mut page, [0.0, 0.0]);
    page.hover(middle);
    page.wait("((text) => text.includes('albedo') && text.includes('flip'))(document.getElementById('values').textContent)");
    save_screenshot(&mut page, "flip.png");

    // Wipe against the reference
    page.key("1");
    choose(&mut page, "reference");
    page.key("w");
    page.wait(&format!("{SHOWN}.left === 'reference' && {SHOWN}.right === 'filtered'"));
    page.wait("window.prpf.viewport.frames.has('reference')");

    // Another camera sees something else
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.1, 0.0]), on_image(&mut page, [0.3, 0.1]));
    page.drag(&[from, to]);
    page.wait("!document.querySelector('input[name=view][value=flip]')");
    page.wait("document.querySelector('[data-value=true_error]').hidden");
}

#[test]
fn a_saved_image_is_compared_by_wipe_and_by_flicker() {
    let Some(program) = chromium() else { return };
    let (render, address, folder) = preview(&["--spp", "8"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));
    page.key("s");
    page.wait("[...document.querySelectorAll('#against option')].some((o) => o.textContent === 'named-0001 · 8.0 spp')");
    choose(&mut page, "save:0");
    page.key("w");
    page.wait(&format!("{SHOWN}.left === 'save:0' && window.prpf.viewport.frames.has('save:0')"));
    // The saved image is the one on the right.
    page.wait("window.prpf.viewport.frames.has('filtered')");
    let differs = page.value(
        "(() => { const [a, b] = ['save:0', 'filtered'].map((v) => window.prpf.viewport.frames.get(v).halves); \
         return a.filter((half, i) => half !== b[i]).length; })()",
    );
    assert_eq!(differs, 0);
    save_screenshot(&mut page, "wipe.png");

    page.key("x");
    assert_eq!(page.value("document.getElementById('wipe').hidden"), true, "one way at a time");
    page.wait(&format!(
        "{SHOWN}.right === 'save:0' && document.getElementById('badge').textContent.startsWith('named-0001')"
    ));
    page.wait(&format!(
        "{SHOWN}.right === 'filtered' && document.getElementById('badge').textContent === 'Filtered'"
    ));
    page.key("x");
    page.wait("document.getElementById('badge').hidden");

    // Another run lists it as well
    drop(render);
    let (_render, address) = start_in(folder.path(), "preview", &["--spp", "8"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait("window.prpf && [...document.querySelectorAll('#against option')].some((o) => o.textContent === 'named-0001')");
}

#[test]
fn budgets_and_camera_are_in_reach_without_scrolling() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1280, 800]);
    page.key("b");
    page.wait("document.querySelectorAll('#bookmarks li').length === 1");
    for size in [[1280, 800], [1920, 1080]] {
        page.resize(size);
        page.wait(&format!("innerWidth === {}", size[0]));
        let is_whole = "(() => { const a = document.querySelector('aside'); return a.scrollHeight <= a.clientHeight; })()";
        assert_eq!(page.value(is_whole), true, "{size:?}");
        // With numbers to be corrected as well
        for field in ["spp", "aperture"] {
            enter(&mut page, field, "-1");
            assert_eq!(page.value(is_whole), true, "{size:?} with an explanation at {field}");
        }
    }
    save_screenshot(&mut page, "panel.png");
}
