//! What the page says of its connection, and what it does without one.

use super::*;
use crate::browser::chromium;
use crate::live::{folder_with_scene, start_in, viewer};

const TEXT: &str = "document.getElementById('phase')?.textContent";

#[test]
fn a_loss_and_an_old_token_are_told_apart_and_nothing_is_lost_silently() {
    let Some(program) = chromium() else { return };
    let folder = folder_with_scene();
    let start = |port: &str| {
        let address = format!("127.0.0.1:{port}");
        start_in(folder.path(), "preview", &["--spp", "4", "--preview", &address])
    };
    let (first, address) = start("0");
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));

    // The program is killed: what is commanded meanwhile is refused, and the settings stay those of the render
    drop(first);
    page.wait(&format!("{TEXT}?.includes('no answer from prpf')"));
    page.wait("document.getElementById('save').disabled");
    page.key("s");
    page.wait(
        "[...document.querySelectorAll('#notices p')].some((p) => p.textContent.includes('was not sent'))",
    );
    page.click("input[name=sampling][value=uniform]");
    page.wait("document.querySelector('input[name=sampling]:checked').value === 'adaptive'");
    let lines = "[...document.querySelectorAll('#notices p')].filter((p) => p.textContent.includes('was not sent')).length";
    assert_eq!(page.value(lines), 1, "the same is not shown twice");

    // Neither are other scenes said not to exist
    page.key("o");
    page.wait("document.getElementById('notices').textContent.includes('cannot list the scenes')");
    page.wait("document.getElementById('scenes').hidden && document.title.startsWith('not connected')");

    // Another run at the same address has another token
    let port = address.rsplit(':').next().and_then(|rest| rest.split('/').next()).expect("a port");
    let (_second, _) = start(port);
    page.wait(&format!("{TEXT}?.includes('no longer valid')"));
}

#[test]
fn a_full_house_is_told_and_a_place_is_taken_when_there_is_one() {
    let Some(program) = chromium() else { return };
    let (_render, address, _folder) = preview(&["--spp", "4"]);
    let silent: Vec<_> = (0..16).map(|_| viewer(&address)).collect();
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("{TEXT}?.includes('waiting for a place')"));
    drop(silent);
    page.wait(&format!("window.prpf.state.status && {PHASE} === 'finished'"));
}

#[cfg(unix)]
fn signal(render: &Running, name: &str) {
    let sent = std::process::Command::new("kill").arg(name).arg(render.0.id().to_string()).status();
    assert!(sent.expect("kill is there").success());
}

/// A link that is dead takes commands until its silence is noticed.
#[cfg(unix)]
#[test]
fn commands_that_may_not_have_arrived_are_named() {
    let Some(program) = chromium() else { return };
    let (render, address, _folder) = preview(&["--spp", "4"]);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait(&format!("window.prpf && window.prpf.state.status && {PHASE} === 'finished'"));
    page.click("input[name=sampling][value=uniform]");
    page.wait("window.prpf.state.status.settings.sampling === 'uniform'");
    signal(&render, "-STOP");
    page.click("input[name=sampling][value=adaptive]");
    page.key("b");
    page.wait("document.getElementById('notices').textContent.includes('check whether prpf has got settings, add bookmark')");
    page.value("(window.prpf.state.status.isOld = true)");
    signal(&render, "-CONT");
    page.wait("window.prpf.state.status && !window.prpf.state.status.isOld");
}

#[cfg(unix)]
#[test]
fn the_end_of_a_render_is_told() {
    let Some(program) = chromium() else { return };
    let folder = folder_with_scene();
    let arguments = ["--preview", "127.0.0.1:0", "--time", "1h", "--spp", "0", "--quiet"];
    let (render, address) = start_in(folder.path(), "render", &arguments);
    let mut page = Page::open(program, &address, [1280, 800]);
    page.wait("window.prpf && window.prpf.state.status");
    signal(&render, "-INT");
    page.wait(&format!("{TEXT} === 'The render has ended.'"));
    assert!(folder.path().join("named.exr").exists());
}
