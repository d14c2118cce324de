//! What a command replaces, and what it never does.

mod command;

use std::path::Path;

use command::{command, prpf, refused};

const SCENE: &str = r#"
Film "rgb" "integer xresolution" 8 "integer yresolution" 8
WorldBegin
LightSource "infinite"
Texture "t" "spectrum" "imagemap" "string filename" "texture.png"
Material "diffuse" "texture reflectance" "t"
Include "ball.pbrt"
"#;

/// A scene of three files.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).expect("a file in it");
    std::fs::write(folder.path().join("ball.pbrt"), "Translate 0 0 4 Shape \"sphere\"")
        .expect("a file in it");
    let white = prpf::image::Planes::new(2, 2, 3);
    prpf::image::png_file::write(&folder.path().join("texture.png"), &white, 0.0).expect("an image");
    folder
}

fn render<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["render", "scene.pbrt", "--spp", "2", "--quiet"], more].concat()
}

fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = prpf(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {said}");
    said
}

#[test]
fn outputs_replace_neither_each_other_nor_what_is_read() {
    let folder = folder();
    let folder = folder.path();
    let files = ["scene.pbrt", "ball.pbrt", "texture.png"];
    let content = || files.map(|name| std::fs::read(folder.join(name)).expect("a file"));
    let before = content();
    std::fs::copy(folder.join("texture.png"), folder.join("reference.png")).expect("a copy");
    for outputs in [
        &["-o", "a.png", "--report", "scene.pbrt"] as &[&str],
        &["-o", "a.png", "--report", "./ball.pbrt"],
        &["-o", "texture.png"],
        &["-o", "a.png", "--state", "texture.png"],
        &["-o", "a.png", "--report", "a.png"],
        &["-o", "a.png", "-o", "./a.png"],
        &["-o", "reference.png", "--reference", "reference.png"],
    ] {
        let said = refused(folder, &render(outputs));
        assert!(said.contains("the same file"), "{said}");
        assert!(!folder.join("a.png").exists());
    }
    assert_eq!(content(), before);
    for name in ["new.png/", "texture.png/"] {
        let said = refused(folder, &render(&["-o", name]));
        assert!(said.contains("found a folder"), "{said}");
        refused(folder, &render(&["-o", "a.png", "--state", name]));
    }
}

/// Links to what is still to come.
#[cfg(unix)]
#[test]
fn outputs_by_way_of_links_do_not_replace_each_other_either() {
    let folder = folder();
    let folder = folder.path();
    for (link, target) in [("state", "a.exr"), ("b.exr", "a.exr"), ("report", "b.exr")] {
        std::os::unix::fs::symlink(target, folder.join(link)).expect("a link");
    }
    for outputs in [
        ["-o", "a.exr", "--state", "state"],
        ["-o", "b.exr", "-o", "a.exr"],
        ["-o", "a.exr", "--report", "report"],
    ] {
        let said = refused(folder, &render(&outputs));
        assert!(said.contains("the same file"), "{said}");
        assert!(!folder.join("a.exr").exists());
    }
    done(folder, &render(&["-o", "b.exr"]));
    assert!(folder.join("a.exr").exists());
}

#[test]
fn an_existing_state_is_replaced_with_a_warning_and_any_other_file_is_not() {
    let folder = folder();
    let folder = folder.path();
    let loud = ["render", "scene.pbrt", "--spp", "2", "-o", "a.png", "--state", "a.state"];
    // As from a script that asks the system for a name.
    std::fs::write(folder.join("a.state"), "").expect("a file");
    assert!(!done(folder, &loud).contains("replaces"));
    assert!(done(folder, &loud).contains("--state replaces the existing state"));
    assert!(!done(folder, &[&loud[..], &["--resume"]].concat()).contains("replaces"));
    let said = refused(folder, &render(&["-o", "a.png", "--state", "ball.pbrt"]));
    assert!(said.contains("same file"), "{said}");
    std::fs::write(folder.join("notes"), "of a year").expect("a file");
    let said = refused(folder, &render(&["-o", "a.png", "--state", "notes"]));
    assert!(said.contains("notes: found no render state"), "{said}");
    assert_eq!(std::fs::read(folder.join("notes")).expect("a file"), b"of a year");
}

#[test]
fn a_merge_replaces_neither_what_it_reads_nor_anything_but_a_state() {
    let folder = folder();
    let folder = folder.path();
    for (shard, state) in [("1/2", "1.state"), ("2/2", "2.state")] {
        done(
            folder,
            &[
                "render",
                "scene.pbrt",
                "--spp",
                "4",
                "--quiet",
                "-o",
                "a.png",
                "--shard",
                shard,
                "--state",
                state,
            ],
        );
    }
    let first = std::fs::read(folder.join("1.state")).expect("a state");
    let merge = |sum: &'static str| ["merge", "1.state", "2.state", "-o", sum];
    assert!(refused(folder, &merge("1.state")).contains("same file"));
    assert!(refused(folder, &merge("texture.png")).contains("no render state"));
    assert!(refused(folder, &merge("none/sum.state")).contains("found no folder"));
    assert_eq!(std::fs::read(folder.join("1.state")).expect("a state"), first);
    done(folder, &merge("sum.state"));
    done(folder, &merge("sum.state"));
}

/// As a disk that is full under one of them.
#[test]
fn what_cannot_be_written_takes_nothing_else_with_it() {
    let folder = folder();
    let folder = folder.path();
    std::fs::create_dir(folder.join("gone")).expect("a folder");
    let outputs = [
        "-o",
        "gone/a.exr",
        "-o",
        "gone/c.png",
        "-o",
        "b.png",
        "--report",
        "r.json",
        "--spp",
        "0",
        "--time",
        "1500ms",
    ];
    let render = [&["render", "scene.pbrt", "--quiet"], &outputs[..]].concat();
    let child = command(folder, &render).spawn().expect("it starts");
    std::thread::sleep(std::time::Duration::from_millis(600));
    std::fs::remove_dir(folder.join("gone")).expect("an empty folder");
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(1)
            && ["gone/a.exr", "gone/c.png"].iter().all(|name| said.contains(name))
            && said.lines().count() == 1,
        "{said}"
    );
    assert!(folder.join("b.png").exists() && folder.join("r.json").exists());
}

#[test]
fn layers_are_asked_for_where_there_are_some() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &render(&["-o", "a.png", "--state", "a.state"]));
    let denoise =
        |outputs: &[&'static str]| [&["denoise", "a.state", "--layers", "Albedo,Ns"], outputs].concat();
    assert!(refused(folder, &denoise(&["-o", "a.png"])).contains("-o FILE.exr"));
    // Not over the image that a render of this name wrote
    done(folder, &denoise(&[]));
    assert!(folder.join("a-denoised.exr").exists() && !folder.join("a.exr").exists());
    done(folder, &denoise(&["-o", "a.png", "-o", "a.exr", "--denoiser", "none"]));
    let channels = prpf::image::exr_file::read_info(&folder.join("a.exr")).expect("an image").channels;
    assert_eq!(channels, ["Albedo.B", "Albedo.G", "Albedo.R", "B", "G", "Ns.X", "Ns.Y", "Ns.Z", "R"]);
    // All that are ever written can be asked for.
    done(folder, &["denoise", "a.state", "-o", "all.exr"]);
    let channels = prpf::image::exr_file::read_info(&folder.join("all.exr")).expect("an image").channels;
    let layers: std::collections::BTreeSet<&str> =
        channels.iter().filter_map(|channel| Some(channel.split_once('.')?.0)).collect();
    assert!(layers.len() >= 8, "{layers:?}");
    let names = layers.into_iter().collect::<Vec<_>>().join(",");
    done(folder, &["denoise", "a.state", "-o", "same.exr", "--layers", &names]);
    let error = refused(folder, &["denoise", "a.state", "-o", "b.exr", "--layers", "Noisy,Depth"]);
    assert!(error.contains("`Depth`") && error.contains("SampleCount"), "{error}");
}

/// Before the first sample there is nothing to lose.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_while_the_scene_is_read_ends_the_program_at_once() {
    let folder = folder();
    let folder = folder.path();
    let many = "Shape \"sphere\"\n".repeat(2_000_000);
    std::fs::write(folder.join("ball.pbrt"), many).expect("a file");
    for (mode, expected) in [("render", 130), ("preview", 0)] {
        let mut child =
            command(folder, &[mode, "scene.pbrt", "-o", "a.png", "--quiet"]).spawn().expect("it starts");
        // Until it listens to signals.
        let status = format!("/proc/{}/status", child.id());
        let listens = || {
            let status = std::fs::read_to_string(&status).expect("a process");
            let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:\t")).expect("a mask");
            u64::from_str_radix(caught, 16).expect("a mask") & 1 << (signal_hook::consts::SIGTERM - 1) != 0
        };
        while !listens() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let sent = std::process::Command::new("kill").arg(child.id().to_string()).status();
        assert!(sent.expect("a signal can be sent").success());
        assert_eq!(child.wait().expect("a child ends").code(), Some(expected), "{mode}");
        assert!(!folder.join("a.png").exists());
    }
}
