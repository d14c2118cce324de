//! Renders that survive: stopped, killed and resumed anywhere, the image is that of a render that was
//! never stopped; what is wrong with a state gets one line, and the old file is still there.

mod command;
mod common;
mod recorder;

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use command::{command, prpf, refused};
use common::SCENE;
use prpf::adaptive::PrioritySettings;
use prpf::filter::{Denoiser, nlm, prpf as pixelwise};
use prpf::geometry::Accel;
use prpf::image::{Planes, exr_file};
use prpf::progressive::{Budget, PassRecord, Position, RenderLoop, Settings, Speed, StoppedBy, run};
use prpf::render::{Renderer, Shard};
use prpf::scene::pbrt;
use prpf::state::{self, ImageMetadata, RenderState, Stream};
use prpf::stats::Store;
use recorder::Recorder;

const SPP: &str = "40";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).expect("a file in it");
    folder
}

/// Runs a command that must succeed.
fn done(folder: &Path, arguments: &[&str]) {
    let output = prpf(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn render<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["render", "scene.pbrt", "--spp", SPP, "--quiet"], more].concat()
}

fn image(folder: &Path, name: &str) -> Planes {
    let channels = ["R", "G", "B", "Noisy.R", "SampleCount.X", "FilterResidual.X", "TileError.X"];
    exr_file::read_channels(&folder.join(name), &channels).expect("an image")
}

/// In the middle of batches, between them and at the end, with and without a reservoir.
#[test]
fn a_render_resumed_from_any_step_ends_in_the_same_image() {
    let scene = pbrt::read_str(SCENE, Path::new(".")).expect("the test's scene is right");
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 5);
    let metadata = ImageMetadata::new(&scene, &renderer);
    for denoiser in [&nlm::STANDARD as &'static dyn Denoiser, &pixelwise::PRPF] {
        let budget = Budget { spp: Some(19), ..Budget::default() };
        // Adaptive, however little is expected of it
        let priority = PrioritySettings { max_ratio: f32::MAX, ..PrioritySettings::default() };
        let settings = Settings { budget, denoiser, priority, seed: 5, ..Settings::default() };
        let render_loop = || RenderLoop::new(&renderer, &settings, Instant::now());
        let mut recorder = Recorder::at_every_step();
        let whole = run(render_loop(), &mut recorder);
        let checkpoints = recorder.checkpoints;
        assert!(checkpoints.len() >= 6, "steps of batches, and their ends: {}", checkpoints.len());
        for checkpoint in checkpoints {
            // By way of a file
            let streams = vec![Stream::new(5, Shard::WHOLE)];
            let state = RenderState {
                metadata: metadata.clone(),
                settings: settings.clone(),
                weights: None,
                streams,
                checkpoint,
            };
            let mut file = Vec::new();
            state::encode(&state, &mut file);
            let checkpoint = state::decode(&file).expect("a state").checkpoint;

            let resumed = run(RenderLoop::resume(&renderer, &settings, Instant::now(), checkpoint), &mut ());
            assert_eq!(resumed.result.image, whole.result.image);
            assert_eq!(resumed.result.interpolation, whole.result.interpolation);
            assert_eq!(resumed.store.rows(), whole.store.rows());
            let passes = |passes: &[PassRecord]| {
                passes.iter().map(|p| (p.index, p.samples_total, p.estimated_error)).collect::<Vec<_>>()
            };
            assert_eq!(passes(&resumed.passes), passes(&whole.passes));
        }
    }
}

/// On a slow machine the rest of a batch may take minutes.
#[test]
fn a_batch_that_would_go_on_is_left_when_interrupted_and_resumed_to_the_same_image() {
    let scene = pbrt::read_str(SCENE, Path::new(".")).expect("the test's scene is right");
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 5);
    let settings =
        Settings { budget: Budget { spp: Some(32), ..Budget::default() }, seed: 5, ..Settings::default() };
    let render_loop = || RenderLoop::new(&renderer, &settings, Instant::now());
    let mut recorder = Recorder::at_every_step();
    let whole = run(render_loop(), &mut recorder);
    let is_within = |position: &Position| matches!(position, Position::Render(_));
    let mut checkpoints = recorder.checkpoints.into_iter();
    let mut within =
        checkpoints.find(|checkpoint| is_within(&checkpoint.position)).expect("steps of batches");
    let before = within.store.samples();
    // So slow that nothing of the batch can be waited for.
    within.speed = Speed { samples: 1.0, seconds: 1e9 };
    let mut stopping = Recorder { interval: Some(f64::INFINITY), interrupts: true, ..Recorder::default() };
    let stopped = run(RenderLoop::resume(&renderer, &settings, Instant::now(), within), &mut stopping);
    assert_eq!(stopped.stopped_by, StoppedBy::Interrupt);
    assert!(stopped.store.samples() > before);
    let [checkpoint] = stopping.checkpoints.try_into().expect("one checkpoint, at the end");
    assert!(is_within(&checkpoint.position));
    let resumed = run(RenderLoop::resume(&renderer, &settings, Instant::now(), checkpoint), &mut ());
    assert_eq!(resumed.result.image, whole.result.image);
    assert_eq!(resumed.store.rows(), whole.store.rows());
}

/// Kills a render `kills` times at moments spread over its length, resuming it each time.
fn killed_again_and_again(kills: u32) {
    let folder = folder();
    let folder = folder.path();
    let started = Instant::now();
    done(folder, &render(&["-o", "whole.exr"]));
    let length = started.elapsed();
    let arguments = render(&["-o", "out.exr", "--state", "a.state", "--resume", "--state-every", "20ms"]);
    for kill in 0..kills {
        let mut child: Child = command(folder, &arguments).spawn().expect("the program starts");
        // The golden ratio spreads the moments evenly, however many there are.
        let share = (0.5 + f64::from(kill) * 0.618_034).fract();
        std::thread::sleep(Duration::from_secs_f64(1.1 * share * length.as_secs_f64()));
        child.kill().expect("a child can be killed");
        let status = child.wait().expect("a child ends");
        assert!(status.code().is_none_or(|code| code == 0), "killed or done: {status}");
        if folder.join("a.state").exists() {
            RenderState::read(&folder.join("a.state")).expect("a state that loads");
        }
        if status.success() {
            // It got to its end; the next starts from nothing.
            assert_eq!(image(folder, "out.exr"), image(folder, "whole.exr"));
            std::fs::remove_file(folder.join("a.state")).expect("a state");
        }
    }
    done(folder, &arguments);
    assert_eq!(image(folder, "out.exr"), image(folder, "whole.exr"));
    let left = std::fs::read_dir(folder)
        .expect("a folder")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let states: Vec<String> = left.filter(|name| name.contains("a.state")).collect();
    assert_eq!(states, ["a.state"], "nothing piles up");
}

#[test]
fn killed_at_random_moments_the_render_ends_in_the_same_image() {
    /// Few enough for every day; `PRPF_KILLS=100 cargo test --release --test survive` for the long form.
    const KILLS: u32 = 8;
    let asked = std::env::var("PRPF_KILLS").ok().and_then(|text| text.parse().ok());
    killed_again_and_again(asked.unwrap_or(KILLS));
}

/// Starts a command, and waits until it has rendered something: it has written its state, or written it anew.
#[cfg(unix)]
fn begun(folder: &Path, arguments: &[&str]) -> Child {
    let written = || folder.join("a.state").metadata().and_then(|state| state.modified()).ok();
    let before = written();
    let mut child = command(folder, arguments).spawn().expect("the program starts");
    while written() == before {
        assert!(child.try_wait().expect("a child").is_none(), "it goes on");
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

#[cfg(unix)]
#[test]
fn a_signal_ends_the_batch_writes_image_and_state_and_exits_130() {
    let folder = folder();
    let folder = folder.path();
    let whole = ["render", "scene.pbrt", "--spp", "4000", "--quiet"];
    done(folder, &[&whole[..], &["-o", "whole.exr"]].concat());
    let arguments =
        [&whole[..], &["-o", "out.exr", "--state", "a.state", "--state-every", "30ms", "--resume"]].concat();
    for signal in ["INT", "TERM"] {
        let mut child = begun(folder, &arguments);
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-s", signal, &id]).status().expect("kill is there").success());
        assert_eq!(child.wait().expect("a child ends").code(), Some(130), "{signal}");
        // Without TileError: the signal may come before most pixels have samples in both halves.
        let channels = ["R", "G", "B", "Noisy.R", "SampleCount.X"];
        let image = exr_file::read_channels(&folder.join("out.exr"), &channels).expect("an image");
        assert!(image.data().iter().all(|v| v.is_finite()));
        RenderState::read(&folder.join("a.state")).expect("a state that loads");
    }
    done(folder, &arguments);
    assert_eq!(image(folder, "out.exr"), image(folder, "whole.exr"));
}

#[cfg(unix)]
#[test]
fn a_second_signal_ends_the_program_at_once() {
    let folder = folder();
    // Another one, as two of a kind may arrive as one.
    end_by_signals(folder.path(), "kill -s TERM $0; kill -s INT $0");
    assert!(!folder.path().join("out.exr").exists(), "no time is taken for an image");
}

/// Renders out.exr and a.state without an end, sends signals by the shell's `commands` to the process $0, and waits for exit status 130.
#[cfg(unix)]
fn end_by_signals(folder: &Path, commands: &str) {
    let render = ["render", "scene.pbrt", "--spp", "1000000", "--quiet", "-o", "out.exr"];
    let arguments = [&render[..], &["--state", "a.state", "--state-every", "30ms"]].concat();
    let mut child = begun(folder, &arguments);
    let sent = Command::new("sh").args(["-c", commands, &child.id().to_string()]).status();
    assert!(sent.expect("a shell").success());
    assert_eq!(child.wait().expect("a child ends").code(), Some(130));
}

#[cfg(unix)]
#[test]
fn a_second_sigterm_leaves_the_time_for_image_and_state() {
    let folder = folder();
    end_by_signals(folder.path(), "kill -s TERM $0; sleep 0.02; kill -s TERM $0");
    assert!(["out.exr", "a.state"].iter().all(|file| folder.path().join(file).exists()));
}

#[test]
fn a_finished_render_is_written_again_and_goes_on_with_a_larger_budget() {
    let folder = folder();
    let folder = folder.path();
    let state = ["--state", "a.state", "--resume"];
    let with = |more: &[&'static str]| [&["render", "scene.pbrt", "--quiet"], &state[..], more].concat();
    done(folder, &with(&["--spp", "8", "-o", "a.exr"]));
    done(folder, &with(&["--spp", "8", "-o", "b.exr"]));
    done(folder, &["denoise", "a.state", "-o", "c.exr"]);
    assert_eq!(image(folder, "b.exr"), image(folder, "a.exr"));
    assert_eq!(image(folder, "c.exr"), image(folder, "a.exr"));
    done(folder, &with(&["--spp", "12", "-o", "d.exr"]));
    let counts = exr_file::read_channels(&folder.join("d.exr"), &["SampleCount.X"]).expect("counts");
    assert_eq!(counts.data().iter().sum::<f32>(), 12.0 * 48.0 * 48.0);
}

/// By default a state has what its own denoiser and the layers read. With all statistics it can be filtered by others, and a
/// render goes on from it without the option.
#[test]
fn a_state_keeps_the_statistics_that_are_asked_for() {
    let folder = folder();
    let folder = folder.path();
    let render = |more: &[&'static str]| {
        done(folder, &[&["render", "scene.pbrt", "--quiet", "-o", "a.exr"], more].concat());
    };
    render(&["--state", "needed.state", "--spp", "6"]);
    render(&["--state", "all.state", "--statistics", "all", "--spp", "6"]);
    done(folder, &["denoise", "needed.state", "--denoiser", "nlm", "-o", "b.exr"]);
    done(folder, &["denoise", "all.state", "--quality", "draft", "-o", "b.exr"]);
    let layout = |name: &str| {
        RenderState::read(&folder.join(name)).expect("a state").checkpoint.store.layout().clone()
    };
    let (needed, all) = (layout("needed.state"), layout("all.state"));
    assert!(needed.len() < all.len() && needed.enabled_names() == all.names().collect::<Vec<_>>());
    render(&["--state", "all.state", "--resume", "--spp", "8"]);
    assert_eq!(layout("all.state"), all);

    // What a state lacks cannot be had by going on from it
    let go_on = ["render", "scene.pbrt", "--spp", "8", "--state", "needed.state", "--resume", "-o", "b.exr"];
    for more in [["--statistics", "all"], ["--samples", "c.npz"]] {
        let said = refused(folder, &[&go_on[..], &more].concat());
        assert!(said.contains("which were asked for"), "{said}");
    }
    render(&["--state", "needed.state", "--resume", "--spp", "8", "--layers", "Noisy"]);
}

#[test]
fn a_state_without_statistics_that_a_denoiser_reads_is_refused() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &["render", "scene.pbrt", "--quiet", "--spp", "6", "--state", "lean.state", "-o", "a.exr"]);
    // As a program could write it that keeps those of `nlm` alone
    let path = folder.join("lean.state");
    let mut state = RenderState::read(&path).expect("a state");
    let whole = &state.checkpoint.store;
    let blocks = nlm::STANDARD.reads().blocks.iter().copied().collect();
    let layout = whole.layout().restricted_to(blocks);
    let mut lean = Store::new(whole.width(), whole.height(), layout.clone(), 0, 0);
    for (x, y) in (0..whole.height()).flat_map(|y| (0..whole.width()).map(move |x| (x, y))) {
        (0..6).for_each(|_| lean.push(x, y, &vec![0.5; layout.len()]));
    }
    state.checkpoint.store = lean.into();
    state.write(&path).expect("it can be written");

    let said = refused(folder, &["denoise", "lean.state", "--denoiser", "learned", "-o", "b.exr"]);
    assert!(said.contains("no statistics of P1.x") && said.contains("--statistics all"), "{said}");
    done(folder, &["denoise", "lean.state", "--denoiser", "nlm", "-o", "b.exr"]);
    let resumed = ["render", "scene.pbrt", "--spp", "8", "--state", "lean.state", "--resume", "-o", "b.exr"];
    let said = refused(folder, &resumed);
    assert!(said.contains("P1.x") && said.contains("--statistics all keeps them"), "{said}");
}

#[test]
fn shards_of_a_render_add_up_to_it() {
    let folder = folder();
    let folder = folder.path();
    let render = |more: &[&'static str]| {
        done(
            folder,
            &[
                &[
                    "render",
                    "scene.pbrt",
                    "--spp",
                    "14",
                    "--sampling",
                    "uniform",
                    "--quiet",
                    "--statistics",
                    "all",
                ],
                more,
            ]
            .concat(),
        );
    };
    render(&["-o", "whole.exr", "--state", "whole.state"]);
    render(&["-o", "s.exr", "--state", "1.state", "--shard", "1/3"]);
    render(&["-o", "s.exr", "--state", "2.state", "--shard", "2/3"]);
    render(&["-o", "s.exr", "--state", "3.state", "--shard", "3/3"]);
    done(folder, &["merge", "3.state", "1.state", "2.state", "-o", "sum.state"]);
    let read = |name: &str| RenderState::read(&folder.join(name)).expect("a state");
    let (sum, whole) = (read("sum.state"), read("whole.state"));
    assert_eq!(sum.streams, whole.streams);
    let (sum, whole) = (&sum.checkpoint.store, &whole.checkpoint.store);
    use prpf::stats::Part::{Half, Whole};
    let all = 0..sum.layout().len();
    for part in [Whole, Half(0), Half(1)] {
        assert_eq!(sum.counts(part), whole.counts(part));
        for (a, b) in [
            (sum.means(part, all.clone()), whole.means(part, all.clone())),
            (sum.variances(part, all.clone()), whole.variances(part, all.clone())),
        ] {
            for (a, b) in a.data().iter().zip(b.data()) {
                assert!((a - b).abs() <= 1e-5 * (1.0 + b.abs()), "{a} {b}");
            }
        }
    }
    let said = refused(folder, &["merge", "1.state", "2.state", "1.state", "-o", "sum.state"]);
    assert!(said.contains("same samples"), "{said}");
    done(folder, &["denoise", "sum.state", "-o", "sum.exr", "--quality", "draft"]);
}

#[test]
fn a_state_that_does_not_fit_gets_one_line_and_stays() {
    let folder = folder();
    let folder = folder.path();
    std::fs::write(folder.join("other.pbrt"), SCENE.replace("0.7 0.6 0.5", "0.7 0.6 0.4")).expect("a file");
    let output = ["--quiet", "-o", "a.exr", "--spp", "4", "--state", "a.state"];
    done(folder, &[&["render", "scene.pbrt"], &output[..]].concat());
    let state = std::fs::read(folder.join("a.state")).expect("a state");
    let resume = [&output[..], &["--resume"]].concat();
    let cases: [(&str, &[&str], &str); 6] = [
        ("other.pbrt", &[], "scene: found"),
        ("scene.pbrt", &["--seed", "2"], "seed"),
        ("scene.pbrt", &["--resolution", "24x24"], "resolution: found a state of 48x48"),
        ("scene.pbrt", &["--max-depth", "2"], "integrator"),
        ("scene.pbrt", &["--shard", "1/2"], "shard"),
        ("scene.pbrt", &["--denoiser", "prpf"], "reservoir"),
    ];
    for (scene, more, expected) in cases {
        let said = refused(folder, &[&["render", scene], &resume[..], more].concat());
        assert!(said.contains(expected) && said.contains("a.state"), "{said}");
        assert_eq!(std::fs::read(folder.join("a.state")).expect("a state"), state);
    }

    for (name, content, expected) in [
        ("cut", state[..state.len() / 2].to_vec(), "truncated"),
        (
            "flipped",
            state.iter().enumerate().map(|(i, &b)| if i == 5000 { b ^ 4 } else { b }).collect(),
            "damaged",
        ),
        ("image", b"\x89PNG\r\n".to_vec(), "no render state"),
    ] {
        std::fs::write(folder.join(name), &content).expect("a file");
        let said = refused(folder, &["denoise", name, "-o", "b.exr"]);
        assert!(said.contains(expected) && said.contains(name), "{said}");
        let render =
            ["render", "scene.pbrt", "--quiet", "-o", "b.exr", "--spp", "4", "--resume", "--state", name];
        assert!(refused(folder, &render).contains(expected));
        assert_eq!(std::fs::read(folder.join(name)).expect("a file"), content);
    }
    assert!(!folder.join("b.exr").exists());

    let nobodys = if cfg!(target_os = "linux") { "/proc/a.state" } else { "missing/a.state" };
    let nobodys_word = if cfg!(target_os = "linux") { nobodys } else { "found no folder" };
    for (path, word) in [
        ("missing/a.state", "missing/a.state: found no folder missing"),
        ("/dev/full", "/dev/full: "),
        (".", ".: found a folder"),
        (nobodys, nobodys_word),
    ] {
        let said = refused(
            folder,
            &["render", "scene.pbrt", "--quiet", "-o", "b.exr", "--spp", "4", "--state", path],
        );
        assert!(said.contains(word), "{said}");
    }
    let own = prpf::files::ExclusiveFile::new(&folder.join("a.state")).expect("nobody else keeps it");
    for more in [&[] as &[&str], &["--resume"]] {
        let render = ["render", "scene.pbrt", "--quiet", "-o", "b.exr", "--spp", "4", "--state", "a.state"];
        assert!(refused(folder, &[&render[..], more].concat()).contains("another program"));
    }
    drop(own);
    // Before there is one as well.
    let early = prpf::files::ExclusiveFile::new(&folder.join("new.state")).expect("nobody else keeps it");
    let render = ["render", "scene.pbrt", "--quiet", "-o", "b.exr", "--spp", "4", "--state", "new.state"];
    assert!(refused(folder, &render).contains("another program"));
    drop(early);
    refused(folder, &["denoise", "a.state", "--denoiser", "prpf", "-o", "b.exr"]);
    refused(folder, &["denoise", "a.state", "--layers", "Depth", "-o", "b.exr"]);
    refused(folder, &["export", "missing", "-o", "b.npz"]);
    // Longer than any memory.
    #[cfg(unix)]
    assert!(refused(folder, &["denoise", "/dev/zero", "-o", "b.exr"]).contains("no render state"));
    assert!(refused(folder, &["export", "a.state", "-o", "./a.state"]).contains("accepted is .npz"));
    // Whatever its name is, it is not replaced by what is no state.
    std::fs::copy(folder.join("a.state"), folder.join("v.npz")).expect("a copy");
    std::fs::copy(folder.join("a.state"), folder.join("v.exr")).expect("a copy");
    let render = ["render", "scene.pbrt", "--quiet", "-o", "b.exr", "--report", "v.exr"];
    for over in
        [&["export", "a.state", "-o", "v.npz"] as &[&str], &["denoise", "a.state", "-o", "v.exr"], &render]
    {
        assert!(refused(folder, over).contains("found a render state"));
    }
    #[cfg(unix)]
    {
        let made = std::process::Command::new("mkfifo").arg(folder.join("pipe")).status();
        assert!(made.expect("mkfifo").success());
        std::fs::copy(folder.join("a.state"), folder.join("b.exr")).expect("a copy");
        for wait in [
            &["denoise", "pipe", "-o", "c.exr"] as &[&str],
            &["compare", "pipe", "b.exr"],
            &["render", "scene.pbrt", "--quiet", "-o", "c.exr", "--reference", "pipe"],
            &["denoise", "pipe", "b.exr", "-o", "c.exr"],
            &["compare", "--layer", "Noisy", "pipe", "b.exr"],
        ] {
            assert!(refused(folder, wait).contains("pipe: "));
        }
    }
    assert_eq!(std::fs::read(folder.join("a.state")).expect("a state"), state);
    refused(folder, &["merge", "a.state", "-o", "b.state"]);
}

/// Wherever memory ends, the program says so in one line, and the state stays.
#[test]
#[cfg(target_os = "linux")]
fn too_little_memory_gets_one_line_and_the_state_stays() {
    let folder = folder();
    done(folder.path(), &render(&["-o", "a.exr", "--state", "a.state"]));
    let state = std::fs::read(folder.path().join("a.state")).expect("it was written");
    let mut failures = 0;
    for megabytes in [30, 45, 60, 90, 120, 140, 160, 2000] {
        let limit = format!("ulimit -v {}; exec \"$@\"", megabytes * 1000);
        let output = Command::new("sh")
            .current_dir(folder.path())
            .args(["-c", &limit, "sh", env!("CARGO_BIN_EXE_prpf"), "render", "scene.pbrt", "--quiet"])
            .args(["-o", "b.exr", "--state", "a.state", "--resume", "--threads", "2", "--spp", "50"])
            .output()
            .expect("a shell");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.success() {
            // Later ones would find a finished render.
            std::fs::write(folder.path().join("a.state"), &state).expect("a writable folder");
            continue;
        }
        failures += 1;
        assert!(matches!(output.status.code(), Some(1 | 2)), "{megabytes} MB: {said}");
        assert_eq!(said.lines().count(), 1, "{megabytes} MB: {said}");
        done(folder.path(), &["denoise", "a.state", "-o", "c.exr", "--quiet"]);
    }
    assert!((2..8).contains(&failures), "{failures} of 8 limits were too low");
}

#[test]
fn an_export_is_an_archive_of_numpy_arrays() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &render(&["-o", "a.exr", "--denoiser", "prpf", "--state", "a.state"]));
    done(folder, &["export", "a.state", "-o", "a.npz", "--threads", "1"]);
    let file = std::fs::File::open(folder.join("a.npz")).expect("a file");
    let mut archive = zip::ZipArchive::new(file).expect("an archive");
    let mut bytes_of = |name: &str| {
        let mut bytes = Vec::new();
        let mut entry = archive.by_name(&format!("{name}.npy")).expect(name);
        std::io::copy(&mut entry, &mut bytes).expect("readable");
        bytes
    };
    let state = RenderState::read(&folder.join("a.state")).expect("a state");
    let store = &state.checkpoint.store;
    let count = bytes_of("count");
    let values: Vec<u32> = count[128..].as_chunks().0.iter().map(|&b| u32::from_le_bytes(b)).collect();
    assert_eq!(values, store.counts(prpf::stats::Part::Whole));
    assert_eq!(bytes_of("mean_a").len(), 128 + 8 * store.layout().len() * store.pixels());
    for name in
        ["reservoir", "reservoir_count", "m2", "feature_weights", "dimension_units", "header", "image"]
    {
        assert!(bytes_of(name).starts_with(b"\x93NUMPY"), "{name}");
    }
}

/// A disk that is full after a megabyte: writing fails as it would there.
#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_is_full_leaves_the_old_state_and_the_image() {
    let folder = folder();
    let folder = folder.path();
    let arguments = render(&["-o", "a.exr", "--state", "a.state", "--resume", "--state-every", "1ms"]);
    done(folder, &[&["render", "scene.pbrt", "--spp", "8", "--quiet"], &arguments[5..]].concat());
    std::fs::remove_file(folder.join("a.exr")).expect("an image");
    let state = std::fs::read(folder.join("a.state")).expect("a state");
    assert!(state.len() > 1 << 20, "{}", state.len());
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 2048; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_prpf")])
        .args(&arguments)
        .current_dir(folder)
        .output()
        .expect("a shell");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let (warnings, error) = said.trim_end().rsplit_once('\n').expect("a warning and an error");
    assert!(warnings.contains("warning: a.state: cannot write the state"), "{said}");
    assert!(error.contains("a.state") && warnings.lines().count() == 1, "{said}");
    assert!(std::fs::read(folder.join("a.state")).expect("a state") == state, "the old one is still there");
    assert!(folder.join("a.exr").exists());
    let left = std::fs::read_dir(folder).expect("a folder").count();
    assert_eq!(left, 3, "the scene, the image and the state");
}

/// What the arrays say is enough to compute a pixel of the filter again, in another language.
#[test]
fn a_script_finds_the_same_pixel_in_exported_arrays() {
    let has_numpy = |python: &&str| {
        let status = Command::new(python).args(["-c", "import numpy"]).stderr(Stdio::null()).status();
        status.is_ok_and(|status| status.success())
    };
    // The first may be one without the distribution's packages.
    let Some(python) = ["python3", "/usr/bin/python3"].into_iter().find(has_numpy) else {
        println!("skipped: no python3 with numpy on this machine");
        return;
    };
    let folder = folder();
    let folder = folder.path();
    done(folder, &render(&["-o", "a.exr", "--denoiser", "prpf", "--state", "a.state"]));
    done(folder, &["export", "a.state", "-o", "a.npz"]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/numpy/one_pixel.py");
    for pixel in [["24", "30"], ["2", "45"]] {
        let output = Command::new(python).arg(&script).arg(folder.join("a.npz")).args(pixel).output();
        let output = output.expect("python starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    }
}

#[test]
fn a_render_that_is_looked_at_keeps_its_state_and_ends_in_the_same_image() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &render(&["-o", "whole.exr"]));
    let live = render(&["--preview", "--state", "a.state", "--resume", "-o", "out.exr"]);
    done(folder, &live);
    assert!(image(folder, "out.exr") == image(folder, "whole.exr"), "looked at from the start");
    std::fs::remove_file(folder.join("out.exr")).expect("an image");
    // Nothing is left to render of a smaller budget, and what there is has been taken over.
    done(folder, &[&["render", "scene.pbrt", "--spp", "8", "--quiet"], &live[5..]].concat());
    let counts = exr_file::read_channels(&folder.join("out.exr"), &["SampleCount.X"]).expect("counts");
    assert_eq!(counts.data().iter().sum::<f32>(), 40.0 * 48.0 * 48.0, "looked at again");
}

/// Interrupts a command as soon as there is a state; the status that it ends with.
#[cfg(unix)]
fn interrupted(folder: &Path, arguments: &[&str]) -> Option<i32> {
    let state = ["--state", "a.state", "--state-every", "30ms", "--quiet"];
    let mut child = begun(folder, &[arguments, &state[..]].concat());
    let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupt.expect("a signal can be sent").success());
    child.wait().expect("a child ends").code()
}

#[cfg(unix)]
#[test]
fn a_render_that_is_looked_at_ends_with_an_image_when_interrupted() {
    let folder = folder();
    let folder = folder.path();
    let render = ["render", "scene.pbrt", "--preview", "--spp", "2000000", "-o", "out.exr"];
    assert_eq!(interrupted(folder, &render), Some(130));
    let state = RenderState::read(&folder.join("a.state")).expect("a state");
    let counts = exr_file::read_channels(&folder.join("out.exr"), &["SampleCount.X"]).expect("counts");
    let samples = counts.data().iter().map(|&n| f64::from(n)).sum::<f64>();
    assert!(samples > 0.0 && samples == state.checkpoint.store.samples() as f64, "both are of the end");
}

#[cfg(unix)]
#[test]
fn a_preview_that_is_closed_leaves_what_it_has_rendered() {
    let folder = folder();
    let folder = folder.path();
    assert_eq!(interrupted(folder, &["preview", "scene.pbrt", "--spp", "0"]), Some(0));
    let state = RenderState::read(&folder.join("a.state")).expect("a state");
    assert!(state.checkpoint.store.samples() > 0);
}

#[cfg(unix)]
#[test]
fn a_preview_that_is_closed_within_a_batch_is_gone_on_with_to_the_same_image() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &render(&["-o", "whole.exr"]));
    assert_eq!(interrupted(folder, &["preview", "scene.pbrt", "--spp", SPP]), Some(0));
    done(folder, &render(&["--state", "a.state", "--resume", "-o", "out.exr"]));
    assert!(image(folder, "out.exr") == image(folder, "whole.exr"));
}
