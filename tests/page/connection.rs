//! What the page says of its connection, and what it does without one.

use std::process::{Command, Stdio};

use super::*;
use crate::browser::chromium;
use crate::live::{SCENE, first_line};

const TEXT: &str = "document.getElementById('phase').textContent";

/// Starts the program with a page at an address; returns the URL.
fn start(folder: &std::path::Path, command: &str, port: u16, arguments: &[&str]) -> (Running, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_prpf"))
        .current_dir(folder)
        .args([command, "scene.pbrt", "--preview", &format!("127.0.0.1:{port}")])
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .map(Running)
        .expect("the program starts");
    let output = program.0.stdout.take().expect("it was asked for");
    let address = first_line(output, |line| line.strip_prefix("preview at ").map(str::to_owned));
    (program, address.expect("the program says where the page is"))
}

fn folder_with_scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).expect("a file in it");
    folder
}

#[test]
fn a_loss_and_an_old_token_are_told_apart_and_nothing_is_lost_silently() {
    let Some(program) = chromium() else { return };
    let folder = folder_with_scene();
    let (first, address) = start(folder.path(), "preview", 0, &["--spp", "4"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));

    // The program is killed: what is commanded meanwhile is refused, and the settings stay those of the render
    drop(first);
    page.wait(&format!("{TEXT}.includes('no answer from prpf')"));
    page.wait("document.getElementById('save').disabled");
    page.key("s");
    page.wait(
        "[...document.querySelectorAll('#notices p')].some((p) => p.textContent.includes('was not sent'))",
    );
    page.click("input[name=sampling][value=uniform]");
    page.wait("document.querySelector('input[name=sampling]:checked').value === 'adaptive'");

    // Another run at the same address has another token
    let port = address.rsplit(':').next().and_then(|rest| rest.split('/').next()).expect("a port");
    let (_second, _) = start(folder.path(), "preview", port.parse().expect("a number"), &["--spp", "4"]);
    page.wait(&format!("{TEXT}.includes('no longer valid')"));
}

#[test]
fn a_full_house_is_told_and_a_place_is_taken_when_there_is_one() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "4"]);
    let silent: Vec<_> = (0..16).map(|_| crate::live::viewer(&address)).collect();
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("{TEXT}.includes('waiting for a place')"));
    drop(silent);
    page.wait(&format!("window.prpf.state.status && {PHASE} === 'finished'"));
}

#[test]
fn the_end_of_a_render_is_told() {
    let Some(program) = chromium() else { return };
    let folder = folder_with_scene();
    let (_render, address) = start(folder.path(), "render", 0, &["--time", "6s", "--spp", "0", "--quiet"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait("window.prpf && window.prpf.state.status");
    page.wait(&format!("{TEXT} === 'The render has ended.'"));
    assert!(folder.path().join("named.exr").exists());
}
