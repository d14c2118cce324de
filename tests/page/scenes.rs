//! Opening another scene of the same folder, and coming back.

use super::*;
use crate::browser::chromium;
use crate::live::{SCENE, folder_with_scene, start_in};

const SCENE_NAME: &str = "document.getElementById('scene').textContent";
const SAMPLES: &str = "window.prpf.state.status?.statistics.samples";
const PROBLEM: &str = "document.getElementById('notices').textContent.includes('not opened: broken.pbrt:1:')";

fn open_scene(page: &mut Page, name: &str) {
    page.click("#show-scenes");
    let button = format!(
        "[...document.querySelectorAll('#scene-list button')].find((b) => b.textContent === '{name}')"
    );
    page.wait(&button);
    page.value(&format!("{button}.click()"));
}

#[test]
fn another_scene_is_opened_and_the_first_comes_back_with_its_samples() {
    let Some(program) = chromium() else { return };
    let folder = folder_with_scene();
    std::fs::create_dir(folder.path().join("shots")).expect("a folder");
    let wide = SCENE
        .replace("\"integer xresolution\" 96", "\"integer xresolution\" 128")
        .replace("named.exr", "wide.exr");
    std::fs::write(folder.path().join("shots/wide.pbrt"), wide).expect("a file");
    std::fs::write(folder.path().join("broken.pbrt"), "WorldBegin Sphere").expect("a file");
    std::fs::write(folder.path().join("part.pbrt"), "Shape \"sphere\"").expect("a file");

    let (_render, address) = start_in(folder.path(), "preview", &["--spp", "16"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));
    page.key("b");
    page.wait("document.querySelectorAll('#bookmarks li').length === 1");
    let samples = page.value(SAMPLES);

    open_scene(&mut page, "shots/wide.pbrt");
    page.wait(&format!("{SCENE_NAME} === 'wide.pbrt' && window.prpf.state.status?.width === 128"));
    page.wait("window.prpf.viewport.frames.get('filtered')?.width === 128");
    page.wait("document.querySelectorAll('#bookmarks li').length === 0");
    page.wait("document.getElementById('undo').disabled");
    page.key("s");
    page.wait("document.getElementById('notices').textContent.includes('wide-0001.exr')");

    // A scene that cannot be read leads back, and the page says why
    open_scene(&mut page, "broken.pbrt");
    page.wait(PROBLEM);
    assert_eq!(page.value(SCENE_NAME), "wide.pbrt");

    // It stays until a user removes it, also on a page that is opened later
    page.reload();
    page.wait(PROBLEM);
    page.click("#notices .problem button");
    page.wait(&format!("!{PROBLEM}"));

    open_scene(&mut page, "scene.pbrt");
    page.wait(&format!("{SCENE_NAME} === 'scene.pbrt' && {SAMPLES} === {samples}"));
    page.wait("document.querySelectorAll('#bookmarks li').length === 1");
    page.wait("window.prpf.viewport.frames.get('filtered')?.width === 96");

    // Neither scene can be read any more, until one can be: nothing that was made of it is lost
    open_scene(&mut page, "shots/wide.pbrt");
    page.wait(&format!("{SCENE_NAME} === 'wide.pbrt' && window.prpf.state.status?.width === 128"));
    std::fs::write(folder.path().join("shots/wide.pbrt"), "WorldBegin Sphere").expect("a file");
    open_scene(&mut page, "broken.pbrt");
    page.wait("document.getElementById('phase').textContent === 'not open'");
    page.wait("document.getElementById('notices').textContent.includes('not opened: shots/wide.pbrt:1:')");
    open_scene(&mut page, "scene.pbrt");
    page.wait(&format!("{SCENE_NAME} === 'scene.pbrt' && {SAMPLES} === {samples}"));
    page.wait("document.querySelectorAll('#bookmarks li').length === 1");
}
