//! Undo and redo: what a command replaces can be had back.

use super::*;
use crate::browser::chromium;

const SAMPLES: &str = "window.prpf.state.status.statistics.samples";
const DENOISER: &str = "window.prpf.state.status.settings.denoiser";
const CURVE: &str = "window.prpf.state.status.curve";

/// A page with a finished render of 16 samples per pixel, which records what it sends.
fn finished_page(program: &str) -> (Page, Running, tempfile::TempDir) {
    let (render, address, folder) = preview(&["--spp", "16"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));
    (page, render, folder)
}

#[test]
fn a_finished_render_that_another_denoiser_replaces_can_be_had_back() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = finished_page(program);
    let (samples, generation) = (page.value(SAMPLES), page.value(GENERATION));
    let curve = page.value(CURVE);
    assert!(curve.as_array().is_some_and(|points| !points.is_empty()));
    assert_eq!(page.value("document.getElementById('undo').disabled"), true);

    // The page says what the click costs before it
    page.value("document.querySelector('input[name=denoiser][value=prpf]').focus()");
    page.wait("document.getElementById('meaning').textContent.includes('Begins the render anew, in about')");
    page.value("document.querySelector('input[name=denoiser][value=nlm]').focus()");
    page.wait("document.getElementById('meaning').textContent.includes('Uses the samples so far')");

    page.click("input[name=denoiser][value=prpf]");
    page.wait(&format!("{GENERATION} > {generation} && {DENOISER} === 'prpf'"));
    page.wait("!document.getElementById('undo').disabled");
    assert_eq!(
        page.value("document.getElementById('undo').title"),
        "Back to 16.0 samples per pixel by learned standard (U)"
    );
    page.wait(&format!("{PHASE} === 'finished'"));
    let replaced = page.value(GENERATION);
    page.key("u");
    page.wait(&format!("{GENERATION} > {replaced} && {DENOISER} === 'learned' && {SAMPLES} === {samples}"));
    page.wait("window.prpf.viewport.shown.right === 'filtered'");
    page.wait(&format!("{PHASE} === 'finished'"));
    page.wait("document.querySelector('[data-value=made_by]').textContent === 'learned standard'");
    assert_eq!(page.value(CURVE), curve, "its image and its errors come back as well");

    // And the other one again
    page.shift_key("U");
    page.wait(&format!("{DENOISER} === 'prpf' && {PHASE} === 'finished'"));
    assert_eq!(page.value("document.getElementById('redo').disabled"), true);
}

/// The image of a finished render comes back with it: no pass is made again.
#[test]
fn undo_of_a_finished_render_makes_no_filter_pass() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = finished_page(program);
    let filter_seconds =
        "(({ seconds, filter_fraction }) => seconds * filter_fraction)(window.prpf.state.status.statistics)";
    let before = page.value(filter_seconds).as_f64().expect("a number");
    assert!(before > 0.0);
    page.wait("window.prpf.viewport.frames.has('filtered')");
    page.value("window.before = [...window.prpf.viewport.frames.get('filtered').halves]; 0");

    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.2, 0.1]));
    page.drag(&[from, to]);
    page.wait(&format!("!document.getElementById('undo').disabled && {PHASE} === 'finished'"));
    let moved = page.value(GENERATION);
    page.key("u");
    page.wait(&format!("{GENERATION} > {moved} && {PHASE} === 'finished'"));
    let after = page.value(filter_seconds).as_f64().expect("a number");
    assert!((after / before - 1.0).abs() < 1e-9, "{before} s became {after} s");
    page.wait(&format!(
        "(({{ generation, halves }}) => generation > {moved} && halves.every((half, i) => half === window.before[i])) \
         (window.prpf.viewport.frames.get('filtered'))"
    ));
}

#[test]
fn a_moved_camera_goes_back_with_its_samples() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = finished_page(program);
    let (samples, lines) = (page.value(SAMPLES), page.value("window.prpf.state.status.camera.directives"));
    page.key("c");
    let (from, to) = (on_image(&mut page, [0.0, 0.0]), on_image(&mut page, [0.2, 0.1]));
    page.drag(&[from, to]);
    page.wait(&format!("window.prpf.state.status.camera.directives !== {lines}"));
    page.wait("!document.getElementById('undo').disabled");
    page.click("#undo");
    page.wait(&format!("window.prpf.state.status.camera.directives === {lines} && {SAMPLES} === {samples}"));
}

#[test]
fn a_render_that_cannot_be_kept_is_discarded_after_a_question_only() {
    let Some(program) = chromium() else { return };
    let (mut page, _render, _folder) = finished_page(program);
    let generation = page.value(GENERATION);
    // As if memory were short: the status of a finished render is not sent again.
    page.value("window.prpf.state.status.history.has_room = false");
    page.click("#restart");
    page.wait("document.getElementById('question').open");
    page.wait("document.activeElement.value === 'no'");
    page.key("Escape");
    page.wait("!document.getElementById('question').open");
    assert_eq!(page.value(GENERATION), generation);
    page.click("#restart");
    page.wait("document.getElementById('question').open");

    // As if another viewer had replaced the render meanwhile: the answer does not concern the new one
    page.value(&format!(
        "window.prpf.state.status = {{ ...window.prpf.state.status, generation: {generation} + 1 }}; 0"
    ));
    page.click("#question button[value=yes]");
    page.wait(
        "document.getElementById('notices').textContent.includes('another render has begun meanwhile')",
    );
    page.value(&format!("window.prpf.state.status.generation = {generation}"));

    page.click("#restart");
    page.wait("document.getElementById('question').open");
    page.click("#question button[value=yes]");
    page.wait(&format!("{GENERATION} > {generation}"));
}

/// A denoiser that needs every sample has no room for more of them.
#[test]
fn more_samples_for_rpf_discard_a_render_after_a_question_only() {
    let Some(program) = chromium() else { return };
    let arguments = ["--resolution", "24x16", "--spp", "2", "--denoiser", "rpf", "--sampling", "uniform"];
    let (_render, address, _folder) = preview(&arguments);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));
    let generation = page.value(GENERATION);
    page.value("window.prpf.state.status.history.has_room = false");
    enter(&mut page, "spp", "8");
    page.wait("document.getElementById('question').open");
    page.key("Escape");
    page.wait("!document.getElementById('question').open && document.getElementById('spp').value === '2'");
    assert_eq!(page.value(GENERATION), generation);
}
