//! The camera on the page: its lines, its bookmarks, its focus.

use super::*;
use crate::browser::chromium;

const APERTURE: &str = "window.prpf.state.status.camera.aperture";
const FOCUS: &str = "window.prpf.state.status.camera.focus";

#[test]
fn a_moved_camera_is_shown_saved_and_rendered_again() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, folder) = recording_page(program, [1280, 800]);
    page.key("l");
    page.wait("document.querySelector('#lines pre').textContent.startsWith('LookAt 0 1.5 -4 ')");
    page.key("Escape");
    page.wait("document.getElementById('lines').hidden");

    // Move, set the lens, and save
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.2, 0.1]));
    page.drag(&[from, to]);
    page.wait("!window.prpf.state.status.camera.directives.startsWith('LookAt 0 1.5 -4 ')");
    enter(&mut page, "aperture", "0.05");
    page.wait(&format!("{APERTURE} > 0.04"));
    let lines = page.value("window.prpf.state.status.camera.directives");
    let lines = lines.as_str().expect("a text").to_owned();
    page.wait("window.prpf.state.status.statistics.mean > 8");
    page.click("#save");
    page.wait("window.prpf.state.status.notices.some((n) => n.text.startsWith('saved'))");

    // The lines stand in the saved files
    for name in ["named-0001.exr", "named-0001.png"] {
        let bytes = std::fs::read(folder.path().join(name)).expect("a saved image");
        let found = bytes.windows(lines.len()).any(|window| window == lines.as_bytes());
        assert!(found, "{name} holds {lines}");
    }

    // A render takes them, and sees the same
    std::fs::write(folder.path().join("moved.txt"), &lines).expect("a file");
    let program = env!("CARGO_BIN_EXE_prpf");
    let run = |arguments: &[&str]| {
        std::process::Command::new(program)
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .expect("it starts")
    };
    let rendered =
        run(&["render", "scene.pbrt", "--camera", "moved.txt", "--spp", "16", "-o", "moved.exr", "--quiet"]);
    assert!(rendered.status.success(), "{}", String::from_utf8_lossy(&rendered.stderr));
    let compared = run(&["compare", "moved.exr", "named-0001.exr", "--max-relmse", "0.05"]);
    assert!(compared.status.success(), "{}", String::from_utf8_lossy(&compared.stdout));
    let other = run(&["render", "scene.pbrt", "--spp", "16", "-o", "own.exr", "--quiet"]);
    assert!(other.status.success());
    let compared = run(&["compare", "own.exr", "named-0001.exr", "--max-relmse", "0.05"]);
    assert_eq!(compared.status.code(), Some(1), "the scene's own camera sees something else");
}

#[test]
fn bookmarks_survive_a_reload_and_lead_back() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1280, 800]);
    page.key("c");
    page.key("b");
    page.wait("document.querySelectorAll('#bookmarks li').length === 1");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.2, 0.1]));
    page.drag(&[from, to]);
    page.wait("!window.prpf.state.status.camera.directives.startsWith('LookAt 0 1.5 -4 ')");
    page.click("#add-bookmark");
    page.wait("document.querySelectorAll('#bookmarks li').length === 2");
    page.reload();
    page.wait("document.querySelectorAll('#bookmarks li').length === 2");
    page.wait("window.prpf.state.status !== null");
    page.click("#bookmarks li:first-child button");
    page.wait("window.prpf.state.status.camera.directives.startsWith('LookAt 0 1.5 -4 ')");
    page.wait("document.querySelector('#bookmarks button').getAttribute('aria-pressed') === 'true'");
    page.click("#bookmarks li:last-child button:last-child");
    page.wait("document.querySelectorAll('#bookmarks li').length === 1");
}

#[test]
fn a_focus_on_a_pinhole_says_why_nothing_changes_and_survives_an_aperture() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1280, 800]);
    let generation = page.value(GENERATION);
    page.key("f");
    let at = on_image(&mut page, [0.45, -0.05]);
    page.drag(&[at]);
    page.wait(
        "[...document.querySelectorAll('#notices p')].some((p) => p.textContent.includes('aperture 0'))",
    );
    assert_eq!(page.value(GENERATION), generation, "no sample is lost");
    let focus = page.value(FOCUS).as_f64().expect("a number");
    assert!(focus < 100.0, "{focus}");
    enter(&mut page, "aperture", "0.1");
    page.wait(&format!("{APERTURE} > 0.09 && Math.abs({FOCUS} - {focus}) < 1e-4"));

    // The click has pinned a pixel, which Escape lets go.
    page.wait("window.prpf.state.isPinned && !document.getElementById('cursor').hidden");
    page.value("window.prpf.viewport.canvas.focus()");
    page.key("Escape");
    page.wait("!window.prpf.state.isPinned && document.getElementById('cursor').hidden");
}

#[test]
fn a_number_out_of_range_is_explained_at_its_field() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = recording_page(program, [1280, 800]);
    for (field, text, explanation) in [
        ("spp", "-3", "budgets-explanation"),
        ("spp", "2.5", "budgets-explanation"),
        ("aperture", "x", "camera-explanation"),
    ] {
        enter(&mut page, field, text);
        page.wait(&format!("document.getElementById('{explanation}').textContent.includes('from 0 to')"));
        assert_eq!(
            page.value(&format!("document.getElementById('{field}').value")),
            text,
            "it can be corrected"
        );
        assert_eq!(
            page.value("window.sent.length > 0 && window.sent.some(({ type }) => type === 'settings')"),
            false
        );
    }
    enter(&mut page, "spp", "100000");
    page.wait("document.getElementById('budgets-explanation').hidden && window.prpf.state.status.settings.budget.spp === 100000");
}
