//! Cases on files: damaged and unwritable ones, a program killed while it writes, and too large an image.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use prpf::adaptive::Sampling;
use prpf::geometry::Accel;
use prpf::image::{Planes, exr_file};
use prpf::progressive::{Checkpoint, Position};
use prpf::render::{Renderer, Shard};
use prpf::scene::pbrt;
use prpf::state::{self, ImageMetadata, RenderState, Stream};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::case::Bound::Exactly;
use super::case::Case;
use super::effort::Effort;
use super::program::program;
use super::render_loop::settings;
use super::renders::{NOISY, noisy, render};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = damaged(effort.select(300, 20_000));
    cases.extend(unwritable());
    cases.extend(killed(effort.select(6, 100)));
    cases.push(too_large());
    cases
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder can be made")
}

fn state() -> RenderState {
    let scene = noisy();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 1);
    let store = render(&scene, 2, 1);
    let streams = vec![Stream::new(1, Shard::WHOLE)];
    RenderState {
        metadata: ImageMetadata::new(&scene, &renderer),
        settings: settings(4, Sampling::Uniform, 1),
        weights: None,
        streams,
        checkpoint: Checkpoint { position: Position::Filter, ..Checkpoint::new(store) },
    }
}

fn image() -> Vec<u8> {
    let mut planes = Planes::new(40, 30, 3);
    planes.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v = i as f32);
    let channels: Vec<_> = ["R", "G", "B"]
        .iter()
        .enumerate()
        .map(|(k, name)| exr_file::Channel::new(*name, planes.plane(k), exr_file::Precision::Float))
        .collect();
    exr_file::encode(exr_file::Windows::whole(40, 30), &channels, &[]).expect("an image in memory")
}

/// A binary PLY file of a square.
fn mesh() -> Vec<u8> {
    let mut file =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
            .to_vec();
    [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .for_each(|v| file.extend(v.to_le_bytes()));
    for corners in [[0i32, 1, 2], [0, 2, 3]] {
        file.push(3);
        corners.iter().for_each(|v| file.extend(v.to_le_bytes()));
    }
    file
}

/// Truncated files, and files with one changed bit.
fn damaged(flips: usize) -> Vec<Case> {
    // Make the files and their readers
    let folder = folder();
    let written = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("it can be written to");
        path
    };
    let is_one_line = |message: String| message.lines().count() == 1;
    let read_state = |bytes: &[u8]| state::decode(bytes).map(drop).map_err(|error| error.to_string());
    let read_image = |bytes: &[u8]| {
        let path = written("image.exr", bytes);
        exr_file::read_layer(&path, None).map(drop).map_err(|error| error.to_string())
    };
    let read_mesh = |bytes: &[u8]| {
        written("mesh.ply", bytes);
        let text = "WorldBegin Shape \"plymesh\" \"string filename\" \"mesh.ply\"";
        pbrt::read_str(text, folder.path()).map(drop).map_err(|error| error.to_string())
    };
    type Reader<'a> = &'a dyn Fn(&[u8]) -> Result<(), String>;
    let mut state_file = Vec::new();
    state::encode(&state(), &mut state_file);
    let files: [(&str, Vec<u8>, Reader); 3] = [
        ("a state", state_file, &read_state),
        ("an image", image(), &read_image),
        ("a mesh", mesh(), &read_mesh),
    ];

    // Read damaged copies of each
    let mut cases = Vec::new();
    for (name, file, read) in files {
        let mut rng = Pcg32::seed_from_u64(19);
        let cuts = (0..flips).map(|_| rng.random_range(0..file.len()));
        let accepted = cuts.filter(|&length| !read(&file[..length]).is_err_and(is_one_line)).count();
        cases.push(Case::new(
            format!("{name} truncated at {flips} lengths"),
            "not refused in one line",
            Exactly(0.0),
            accepted as f64,
        ));
        let (mut accepted, mut long_messages) = (0, 0);
        for _ in 0..flips {
            let mut damaged = file.clone();
            damaged[rng.random_range(0..file.len())] ^= 1 << rng.random_range(0..8);
            match read(&damaged) {
                Ok(()) => accepted += 1,
                Err(message) => long_messages += usize::from(!is_one_line(message)),
            }
        }
        let case = format!("{name} with one bit changed, {flips} times");
        cases.push(if name == "a state" {
            Case::new(
                case,
                "not refused in one line",
                Exactly(0.0),
                f64::from(accepted as u32) + long_messages as f64,
            )
        } else {
            Case::new(case, "neither read nor refused in one line", Exactly(0.0), long_messages as f64)
                .with_limitation("the format has no checksum, so a changed number cannot be detected")
        });
    }
    cases
}

/// Outputs to paths that cannot be written.
fn unwritable() -> Vec<Case> {
    let folder = folder();
    let old = folder.path().join("old");
    std::fs::write(&old, "what was there").expect("it can be written to");
    std::fs::create_dir(folder.path().join("folder")).expect("it can be written to");
    let targets = [
        PathBuf::from("/dev/full"),
        folder.path().join("folder"),
        folder.path().join("none/file"),
        old.join("file"),
    ];
    let state = state();
    let (mut states, mut images) = (0, 0);
    for target in &targets {
        states += usize::from(state.write(target).is_err_and(|error| error.to_string().lines().count() == 1));
        let plane = vec![0.0; 12];
        let channel = [exr_file::Channel::new("Y", &plane, exr_file::Precision::Float)];
        let written = exr_file::write(target, exr_file::Windows::whole(4, 3), &channel, &[]);
        images += usize::from(written.is_err_and(|error| error.to_string().lines().count() == 1));
    }
    let entries = std::fs::read_dir(folder.path()).map_or(0, Iterator::count);
    let kept = std::fs::read(&old).is_ok_and(|content| content == b"what was there");
    vec![
        Case::new(
            "a state to a full device, a folder, a missing folder, a path inside a file",
            "refused in one line, of 4",
            Exactly(4.0),
            states as f64,
        ),
        Case::new("an image to the same", "refused in one line, of 4", Exactly(4.0), images as f64),
        Case::new(
            "the same",
            "files changed or left behind",
            Exactly(0.0),
            (entries - 2) as f64 + f64::from(!kept),
        ),
    ]
}

fn run(folder: &Path, arguments: &[&str]) -> Option<Output> {
    Command::new(program()).current_dir(folder).args(arguments).stdout(Stdio::null()).output().ok()
}

/// A render that is killed repeatedly, at times spread over its length, and resumed.
fn killed(kills: u32) -> Vec<Case> {
    // Render without interruption
    let folder = folder();
    let folder = folder.path();
    std::fs::File::create(folder.join("scene.pbrt"))
        .and_then(|mut file| file.write_all(NOISY.as_bytes()))
        .expect("it can be written to");
    let render = ["render", "scene.pbrt", "--spp", "24", "--quiet"];
    let started = Instant::now();
    let whole = run(folder, &[&render[..], &["-o", "whole.exr"]].concat());
    let length = started.elapsed().as_secs_f64();

    // Kill and resume
    let resumable =
        [&render[..], &["-o", "out.exr", "--state", "a.state", "--resume", "--state-every", "10ms"]].concat();
    let mut unreadable = 0;
    for kill in 0..kills {
        // The golden ratio spreads any number of times evenly.
        let fraction = (0.5 + f64::from(kill) * 0.618_034).fract();
        let child =
            Command::new(program()).current_dir(folder).args(&resumable).stdout(Stdio::null()).spawn();
        let Ok(mut child) = child else { continue };
        std::thread::sleep(Duration::from_secs_f64(fraction * length));
        let ended = child.kill().and_then(|()| child.wait());
        let path = folder.join("a.state");
        unreadable += usize::from(ended.is_err() || path.exists() && RenderState::read(&path).is_err());
        if ended.is_ok_and(|status| status.success()) {
            // The render finished; the next one starts anew.
            unreadable += usize::from(std::fs::remove_file(&path).is_err());
        }
    }

    // Finish, and compare the images
    let last = run(folder, &resumable);
    let succeeded = [whole, last].iter().flatten().filter(|output| output.status.success()).count();
    let read = |name: &str| exr_file::read_channels(&folder.join(name), &["R", "G", "B", "SampleCount.X"]);
    let differing = match (read("whole.exr"), read("out.exr")) {
        (Ok(a), Ok(b)) if succeeded == 2 => {
            a.data().iter().zip(b.data()).filter(|(a, b)| a != b).count() as f64
        }
        _ => f64::NAN,
    };
    vec![
        Case::new(
            format!("killed {kills} times"),
            "states that do not load",
            Exactly(0.0),
            unreadable as f64,
        ),
        Case::new(
            "the same, then resumed",
            "values that differ from an uninterrupted render",
            Exactly(0.0),
            differing,
        ),
    ]
}

/// An image that exceeds the memory: refused before the store is allocated, with a size that would fit.
fn too_large() -> Case {
    let folder = folder();
    std::fs::write(folder.path().join("scene.pbrt"), NOISY).expect("it can be written to");
    let arguments = [
        "render",
        "scene.pbrt",
        "--resolution",
        "65535x2048",
        "--state",
        "a.state",
        "--reservoir",
        "64",
        "--quiet",
        "-o",
        "out.exr",
    ];
    let output = run(folder.path(), &arguments).filter(|output| output.status.code() == Some(2));
    let message =
        output.map(|output| String::from_utf8_lossy(&output.stderr).into_owned()).unwrap_or_default();
    let is_right = message.lines().count() == 1 && message.contains("pixels would fit");
    Case::new(
        "an image that exceeds the memory",
        "refused in one line that states what would fit",
        Exactly(1.0),
        f64::from(is_right),
    )
}
