//! The program as a user runs it: what it writes, and what bad input gets.

mod command;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use command::{command, prpf, refused};

const SCENE: &str = r#"
LookAt 0 0 -3  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Integrator "path" "integer maxdepth" 3
Film "rgb" "integer xresolution" 24 "integer yresolution" 16 "string filename" "named.exr"
WorldBegin
LightSource "infinite" "rgb L" [ 0.5 0.6 0.7 ]
Material "diffuse" "rgb reflectance" [ 0.7 0.2 0.2 ]
Shape "sphere" "float radius" 1
"#;

/// The weights that the program embeds.
const WEIGHTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/filter/learned/weights.safetensors");

fn folder_with(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), scene).expect("a file in it");
    folder
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn outputs_name_the_weights_that_are_used() {
    let folder = folder_with(SCENE);
    let mut weights = std::fs::read(WEIGHTS).expect("the weights");
    let last = weights.len() - 1;
    weights[last] ^= 0x80;
    std::fs::write(folder.path().join("other.safetensors"), &weights).expect("other weights");
    let named = |options: &[&str]| {
        let render = ["render", "scene.pbrt", "--spp", "2", "-o", "a.exr", "--report", "a.json"];
        let output = prpf(folder.path(), &[&render, options].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        let report: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.path().join("a.json")).unwrap()).unwrap();
        report["weights"].as_str().map(str::to_owned)
    };
    let own = named(&[]).expect("weights of the default denoiser");
    let other = named(&["--denoiser", "learned", "--weights", "other.safetensors"]);
    assert!(other.is_some_and(|other| other != own && other.len() == 16));
    assert_eq!(named(&["--denoiser", "learned", "--weights", WEIGHTS]), Some(own));
    assert_eq!(named(&["--denoiser", "nlm"]), None);
}

#[test]
fn processes_that_do_not_see_each_other_get_one_line() {
    let folder = folder_with(SCENE);
    let run = |rank: &str, shard: &[&str]| {
        let render = ["render", "scene.pbrt", "--spp", "4", "-o", "a.exr"];
        let mut command = command(folder.path(), &[&render, shard].concat());
        command.envs([("OMPI_COMM_WORLD_SIZE", "2"), ("OMPI_COMM_WORLD_RANK", rank)]);
        command.output().expect("the program starts")
    };
    let [first, second] = ["0", "1"].map(|rank| run(rank, &[]));
    assert_eq!((first.status.code(), second.status.code()), (Some(2), Some(2)));
    assert!(stderr(&first).starts_with("prpf: found 2 processes of a program built without"), "{first:?}");
    assert_eq!((stderr(&first).lines().count(), stderr(&second)), (1, String::new()));
    assert!(!folder.path().join("a.exr").exists());
    let shard = run("1", &["--shard", "2/2"]);
    assert!(shard.status.success(), "{}", stderr(&shard));
}

#[test]
fn render_writes_image_and_report_and_says_where() {
    let folder = folder_with(SCENE);
    let output = prpf(
        folder.path(),
        &["render", "scene.pbrt", "--spp", "8", "-o", "a.exr", "-o", "a.png", "--report", "a.json"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("a.exr") && said.contains("a.png"), "{said}");
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("a.json")).unwrap()).unwrap();
    assert_eq!(report["samples_total"], 8 * 24 * 16);
    assert_eq!((&report["width"], &report["height"]), (&24.into(), &16.into()));
    assert_eq!(report["stopped_by"], "spp");
    for key in [
        "scene",
        "seed",
        "threads",
        "camera",
        "effects",
        "dimensions",
        "settings",
        "seconds",
        "samples_min",
        "samples_max",
        "rejected_samples",
        "peak_memory_bytes",
        "estimated_error",
        "batches",
    ] {
        assert!(report.get(key).is_some(), "{key}");
    }
    let info = prpf::image::exr_file::read_info(&folder.path().join("a.exr")).unwrap();
    for channel in
        ["R", "Noisy.G", "Ns.X", "P.Z", "Variance.B", "Error.X", "SampleCount.X", "FilterResidual.X"]
    {
        assert!(info.channels.iter().any(|c| c == channel), "{channel} of {:?}", info.channels);
    }
}

#[test]
fn without_outfile_the_scenes_name_is_taken() {
    let folder = folder_with(SCENE);
    assert!(prpf(folder.path(), &["render", "scene.pbrt", "--spp", "1", "--quiet"]).status.success());
    assert!(folder.path().join("named.exr").exists());
}

#[test]
fn the_same_command_gives_the_same_bytes() {
    let folder = folder_with(SCENE);
    for (name, threads) in [("a.png", "1"), ("b.png", "2")] {
        assert!(
            prpf(folder.path(), &["render", "scene.pbrt", "--spp", "8", "-o", name, "--threads", threads])
                .status
                .success()
        );
    }
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("a.png"), bytes("b.png"));
}

#[test]
fn random_parameter_filtering_keeps_its_samples_and_says_how_many_bytes_they_are() {
    let folder = folder_with(SCENE);
    let render = |name: &str, threads: &str| {
        let report = format!("{name}.json");
        let output = prpf(
            folder.path(),
            &[
                "render",
                "scene.pbrt",
                "--spp",
                "6",
                "--denoiser",
                "rpf",
                "--threads",
                threads,
                "--quiet",
                "-o",
                name,
            ]
            .into_iter()
            .chain(["--report", &report])
            .collect::<Vec<_>>(),
        );
        assert!(output.status.success(), "{}", stderr(&output));
        let report: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.path().join(report)).unwrap()).unwrap();
        (std::fs::read(folder.path().join(name)).unwrap(), report)
    };
    let (image, report) = render("a.png", "1");
    assert_eq!(report["settings"]["denoiser"], "rpf");
    // Film, colour, position, normal and hit at least, 6 samples of 24×16 pixels.
    assert!(report["reservoir_bytes"].as_u64().unwrap() >= 6 * 24 * 16 * 12 * 4, "{report}");
    let [low, error, high] = ["estimated_error_low", "estimated_error", "estimated_error_high"]
        .map(|key| report[key].as_f64().expect("the image's own samples tell its error"));
    assert!(0.0 < low && low < error && error < high, "{report}");
    assert!(image == render("b.png", "3").0, "the image depends on the threads");
}

#[test]
fn random_parameter_filtering_is_refused_where_its_samples_do_not_fit() {
    let folder = folder_with(SCENE);
    let refused = |arguments: &[&str]| {
        let output =
            prpf(folder.path(), &[&["render", "scene.pbrt", "--denoiser", "rpf"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        stderr(&output)
    };
    let unbounded = refused(&["--time", "5s"]);
    assert!(unbounded.contains("--spp") && unbounded.contains("--max-spp"), "{unbounded}");
    let large = refused(&["--spp", "100000", "--resolution", "8192x8192"]);
    assert!(large.contains("sample vectors each") && large.contains("would fit"), "{large}");
}

#[test]
fn an_image_beyond_all_memory_is_refused_before_it_takes_any() {
    let folder = folder_with(SCENE);
    let kept = ["--state", "a.state", "--reservoir", "1024"];
    for more in [&[] as &[&str], &["--denoiser", "none"], &kept, &["--denoiser", "prpf"]] {
        let large = ["render", "scene.pbrt", "--spp", "1", "--resolution", "65535x2048"];
        let arguments = [&large[..], more].concat();
        let output = prpf(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        let said = stderr(&output);
        assert!(said.lines().count() == 1 && said.contains("would fit"), "{said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "nothing but the scene");
}

#[test]
fn a_wrong_scene_gets_one_line_with_its_place() {
    let folder = folder_with(&SCENE.replace("\"sphere\"", "\"spere\" \"float radius\" [ x ]"));
    let said = refused(folder.path(), &["render", "scene.pbrt", "-o", "a.png"]);
    assert!(said.contains("scene.pbrt:9:"), "{said}");
    assert!(!folder.path().join("a.png").exists());
}

#[test]
fn wrong_command_lines_exit_with_2_and_say_what_is_accepted() {
    let folder = folder_with(SCENE);
    let cases: [(&[&str], &str); 34] = [
        (&["render", "scene.pbrt", "--foo"], "found `--foo`"),
        (&["render", "scene.pbrt", "--qualty", "draft"], "`--quality`"),
        (&["render", "scene.pbrt", "--spp", "many"], "whole number"),
        (&["render", "scene.pbrt", "--spp", "-1"], "whole numbers in the option's range"),
        (&["render", "scene.pbrt", "--time", "-5s"], "20s"),
        (&["render", "scene.pbrt", "--spp", "8", "--max-spp", "4"], "--spp 8: found more than --max-spp 4"),
        (&["render", "scene.pbrt", "--min-spp", "8", "--max-spp", "4"], "--min-spp 8: found more than"),
        (&["render", "scene.pbrt", "--min-spp", "8", "--spp", "4"], "--min-spp 8: found more than --spp 4"),
        (&["render"], "<SCENE>"),
        (&["rendr", "scene.pbrt"], "`render`"),
        (&["render", "scene.pbrt", "--spp"], "no value"),
        (&["render", "missing.pbrt"], "missing.pbrt"),
        (&["render", "scene.pbrt", "-o", "a.bmp"], ".png"),
        (&["render", "scene.pbrt", "--quality", "best"], "standard"),
        (&["render", "scene.pbrt", "--denoiser", "best"], "nlm"),
        (&["render", "scene.pbrt", "--denoiser", "rpf", "--quality", "draft"], "no presets"),
        // Spellings of an earlier version.
        (
            &["render", "scene.pbrt", "--denoiser", "prpf", "--quality", "standard"],
            "--denoiser nlm --quality standard",
        ),
        (&["render", "scene.pbrt", "--quality", "paper"], "--denoiser prpf"),
        (&["render", "scene.pbrt", "--weights", "scene.pbrt"], "not a file of weights"),
        (
            &["render", "scene.pbrt", "--denoiser", "nlm", "--weights", WEIGHTS],
            "accepted with --denoiser learned",
        ),
        (&["render", "scene.pbrt", "--time", "soon"], "20s"),
        (&["render", "scene.pbrt", "--pixelbounds", "0,50,0,10"], "24"),
        (&["render", "scene.pbrt", "--pixelbounds", "-1,5,0,5"], "accepted are four whole numbers"),
        (&["render", "scene.pbrt", "--resolution", "0x0"], "WIDTHxHEIGHT"),
        (&["render", "scene.pbrt", "--reference", "none.exr"], "none.exr"),
        (&["render", "scene.pbrt", "--max-depth", "4294967295"], "whole numbers in the option's range"),
        (
            &["render", "scene.pbrt", "--min-spp", "2000000000", "--time", "1s"],
            "--min-spp 2000000000: accepted",
        ),
        (&["render", "scene.pbrt", "--min-spp", "64"], "--min-spp 64: found more than the scene's 16"),
        (&["render", "scene.pbrt", "--drive", "residual=1,residual=0"], "residual twice"),
        (&["render", "scene.pbrt", "--state-every", "4s"], "--state"),
        (&["render", "scene.pbrt", "-o", "a.png", "--layers", "Albedo"], "accepted with -o FILE.exr"),
        (&["info", "missing.pbrt"], "missing.pbrt"),
        (&["merge", "a.state", "-o", "b.state"], "found 1, and at least 2 are needed"),
        (&["allocate", "a.state", "--spp", "8", "-o", "a.png"], "a.png: unknown extension; accepted is .exr"),
    ];
    for (arguments, expected) in cases {
        let said = refused(folder.path(), arguments);
        assert!(said.contains(expected), "{arguments:?}: {said}");
    }
}

#[test]
fn a_file_that_is_no_text_gets_one_printable_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let noise: Vec<u8> = (0..5000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for (name, bytes) in
        [("noise", noise), ("long", vec![b'a'; 100_000]), ("escape", b"\x1b[2J\x07".to_vec())]
    {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
        let said = refused(folder.path(), &["info", name]);
        assert!(said.len() < 1500, "{name}: {}", said.len());
        assert!(!said.trim_end().chars().any(char::is_control), "{name}: {said:?}");
    }
}

#[test]
fn a_film_name_that_cannot_be_written_is_said_to_be_replaced() {
    let folder = folder_with(&SCENE.replace("named.exr", "named.tga"));
    let output = prpf(folder.path(), &["render", "scene.pbrt", "--spp", "1"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("named.tga") && stderr(&output).contains("scene.exr"),
        "{}",
        stderr(&output)
    );
    assert!(folder.path().join("scene.exr").exists());
    let asked = prpf(folder.path(), &["render", "scene.pbrt", "--spp", "1", "-o", "a.png"]);
    assert!(!stderr(&asked).contains("named.tga"), "nothing was replaced: {}", stderr(&asked));
}

#[test]
fn nobody_listening_is_no_failure() {
    let folder = folder_with(SCENE);
    assert!(
        prpf(folder.path(), &["render", "scene.pbrt", "--spp", "1", "-o", "a.png", "--quiet"])
            .status
            .success()
    );
    for arguments in [&["info", "scene.pbrt"] as &[&str], &["compare", "a.png", "a.png"]] {
        let mut child = command(folder.path(), arguments).spawn().expect("the program starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("the program ends");
        assert_eq!((output.status.code(), stderr(&output).as_str()), (Some(0), ""), "{arguments:?}");
    }
}

/// Arguments of a render that only a signal ends.
#[cfg(unix)]
const ENDLESS: [&str; 8] = ["render", "scene.pbrt", "--spp", "2000000", "-o", "a.exr", "--report", "a.json"];

/// Sends signals to a render with the arguments [`ENDLESS`], and checks what it leaves.
#[cfg(unix)]
fn check_interruption(folder: &Path, child: std::process::Child, signals: &[i32]) {
    // Long enough to have begun: an earlier signal would end the program at once.
    std::thread::sleep(std::time::Duration::from_secs(2));
    for signal in signals {
        let sent = Command::new("kill").arg(format!("-{signal}")).arg(child.id().to_string()).status();
        assert!(sent.expect("kill is there").success());
    }
    let output = child.wait_with_output().expect("the program ends");
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(folder.join("a.exr").exists());
    let report = std::fs::read(folder.join("a.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    assert_eq!(report["stopped_by"], "interrupt");
    // Whole batches of whole samples per pixel.
    assert_eq!(report["samples_total"].as_u64().expect("a number") % (24 * 16), 0);
}

#[cfg(unix)]
#[test]
fn an_interrupted_render_finishes_its_batch_and_writes_the_image() {
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        let folder = folder_with(SCENE);
        let child = command(folder.path(), &ENDLESS).spawn().expect("the program starts");
        check_interruption(folder.path(), child, &[signal]);
    }
}

/// System and shell may both send SIGHUP. `env` lets the program receive it even if the tests run under `nohup`.
#[cfg(target_os = "linux")]
#[test]
fn closing_the_terminal_interrupts_a_render() {
    use signal_hook::consts::SIGHUP;
    let folder = folder_with(SCENE);
    let child = Command::new("env")
        .current_dir(folder.path())
        .args(["--default-signal=HUP", env!("CARGO_BIN_EXE_prpf")])
        .args(ENDLESS)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("env is there");
    check_interruption(folder.path(), child, &[SIGHUP, SIGHUP]);
}

/// `nohup` starts a program with SIGHUP ignored, and it stays ignored.
#[cfg(target_os = "linux")]
#[test]
fn nohup_keeps_a_render_going() {
    let folder = folder_with(SCENE);
    let child = Command::new("nohup")
        .current_dir(folder.path())
        .args([
            env!("CARGO_BIN_EXE_prpf"),
            "render",
            "scene.pbrt",
            "--spp",
            "0",
            "--time",
            "3s",
            "-o",
            "a.png",
        ])
        .args(["--report", "a.json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("nohup is there");
    std::thread::sleep(std::time::Duration::from_secs(1));
    let sent = Command::new("kill").args(["-HUP", &child.id().to_string()]).status();
    assert!(sent.expect("kill is there").success());
    let output = child.wait_with_output().expect("the program ends");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = std::fs::read_to_string(folder.path().join("a.json")).expect("a report");
    assert!(report.contains(r#""stopped_by": "time""#), "{report}");
}

#[test]
fn a_budget_too_small_for_a_sample_per_pixel_ends_in_an_image_and_says_so() {
    let folder = folder_with(SCENE);
    let large = ["render", "scene.pbrt", "--resolution", "512x512", "--time", "1ms", "-o", "a.png"];
    let output = prpf(folder.path(), &large);
    assert!(output.status.success(), "{}", stderr(&output));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("there is less than one sample per pixel"), "{said}");
    assert!(folder.path().join("a.png").exists());
}

#[test]
fn a_target_of_error_ends_the_render_when_the_estimate_says_so() {
    let folder = folder_with(SCENE);
    let target = |error: &str| {
        let arguments = ["--spp", "0", "--target-error", error, "-o", "a.exr", "--report", "a.json"];
        let output = prpf(folder.path(), &[&["render", "scene.pbrt"], &arguments[..]].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        let report = std::fs::read(folder.path().join("a.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        assert_eq!(report["stopped_by"], "target-error");
        let estimate = report["estimated_error"].as_f64().expect("a number");
        (estimate, report["samples_total"].as_u64().expect("a number"))
    };
    let (loose, tight) = (target("1e-2"), target("1e-4"));
    assert!(loose.0 <= 1e-2 && tight.0 <= 1e-4, "{loose:?} {tight:?}");
    assert!(tight.1 > loose.1, "{loose:?} {tight:?}");
}

#[test]
fn samples_that_are_rejected_are_counted_in_the_summary_and_the_report() {
    let lamp = |radiance: &str| {
        format!(
            "{SCENE} AreaLightSource \"diffuse\" \"rgb L\" [ {radiance} {radiance} {radiance} ]
             Translate 0.7 0.3 -1 Shape \"sphere\" \"float radius\" 0.1"
        )
    };
    let of = |radiance: &str| {
        let folder = folder_with(&lamp(radiance));
        let arguments = ["render", "scene.pbrt", "--spp", "8", "-o", "a.png", "--report", "a.json"];
        let output = prpf(folder.path(), &arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        let report = std::fs::read(folder.path().join("a.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        let [rejected, accepted] =
            ["rejected_samples", "samples_total"].map(|key| report[key].as_u64().expect("a number"));
        assert_eq!(rejected + accepted, 8 * 24 * 16);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        // The path of the first one sees the lamp.
        if let Some([x, y, index]) = report["first_rejected_sample"].as_array().map(Vec::as_slice) {
            let sample = format!("{x},{y},{index}");
            assert!(text.contains(&format!("--debug-sample {sample}")), "{text}");
            let output = prpf(folder.path(), &["render", "scene.pbrt", "--debug-sample", &sample]);
            let path = String::from_utf8_lossy(&output.stdout).into_owned();
            assert!(path.contains("emission [10000000"), "{path}");
        } else {
            assert_eq!(rejected, 0, "{report}");
        }
        (rejected, text)
    };
    // Where the lamp is seen, it is beyond what a store accepts.
    let (rejected, said) = of("1e16");
    assert!(
        rejected > 0 && said.contains(&format!("{rejected} samples were rejected")),
        "{rejected}: {said}"
    );
    let (rejected, said) = of("10");
    assert!(rejected == 0 && !said.contains("rejected"), "{rejected}: {said}");
}

#[test]
fn the_hash_of_the_scene_is_in_the_image_and_follows_its_text() {
    let hash = |scene: &str| {
        let folder = folder_with(scene);
        assert!(prpf(folder.path(), &["render", "scene.pbrt", "--spp", "1", "-o", "a.exr"]).status.success());
        let info = prpf::image::exr_file::read_info(&folder.path().join("a.exr")).unwrap();
        let (_, value) = info.attributes.iter().find(|(name, _)| name == "prpf.sceneHash").expect("a hash");
        format!("{value:?}")
    };
    let (one, other) = (hash(SCENE), hash(&SCENE.replace("fov\" 40", "fov\" 41")));
    assert!(one.contains("sha256:") && one == hash(SCENE) && one != other, "{one} {other}");
}

#[test]
fn a_crop_is_that_part_of_the_whole() {
    let folder = folder_with(SCENE);
    let render = |name: &str, more: &[&str]| {
        let mut arguments = vec![
            "render",
            "scene.pbrt",
            "--spp",
            "4",
            "--sampling",
            "uniform",
            "--denoiser",
            "none",
            "-o",
            name,
        ];
        arguments.extend(more);
        assert!(prpf(folder.path(), &arguments).status.success());
        prpf::image::exr_file::read_channels(&folder.path().join(name), &["R"]).unwrap()
    };
    let (whole, crop) = (render("whole.exr", &[]), render("crop.exr", &["--pixelbounds", "5,15,3,10"]));
    assert_eq!((crop.width(), crop.height()), (10, 7));
    for (x, y) in (0..10).flat_map(|x| (0..7).map(move |y| (x, y))) {
        assert_eq!(crop.at(0, x, y), whole.at(0, x + 5, y + 3));
    }
}

#[test]
fn the_events_of_a_sample_are_printed_and_nothing_is_rendered() {
    let folder = folder_with(SCENE);
    let debug = |sample: &str| {
        prpf(folder.path(), &["render", "scene.pbrt", "-o", "a.exr", "--quiet", "--debug-sample", sample])
    };
    let output = debug("12,8,3");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        text.starts_with("ray 0: from ") && text.lines().last().unwrap().starts_with("radiance "),
        "{text}"
    );
    assert!(!folder.path().join("a.exr").exists());
    let outside = debug("24,0,0");
    assert_eq!(outside.status.code(), Some(2));
    assert!(stderr(&outside).contains("X below 24"), "{}", stderr(&outside));
}

#[test]
fn info_shows_effects_and_alive_dimensions() {
    let folder = folder_with(SCENE);
    let output = prpf(folder.path(), &["info", "scene.pbrt"]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && said.contains("environment") && !said.contains("lens.u"), "{said}");
    let denoiser = |name: &str| said.lines().find(|line| line.starts_with(name)).unwrap_or_default();
    assert!(
        denoiser("nlm standard").contains("filters parts of an image with a margin of 70 pixels"),
        "{said}"
    );
    assert!(!denoiser("rpf ").contains("margin"), "{said}");
}

/// The real scenes that stand beside the project on some machines.
#[test]
fn the_cornell_box_agrees_with_its_reference() {
    let scene =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/pbrt-v4/cornell-box/scene-v4.pbrt");
    if !scene.exists() {
        println!("skipped: {} is not here", scene.display());
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let bounds = [256, 512, 512, 768];
    let text: Vec<String> = bounds.iter().map(usize::to_string).collect();
    let scene_text = scene.to_string_lossy().into_owned();
    let arguments = [
        "render",
        &scene_text,
        "--spp",
        "16",
        "--sampling",
        "uniform",
        "--denoiser",
        "none",
        "--pixelbounds",
        &text.join(","),
        "-o",
        "crop.exr",
    ];
    let output = prpf(folder.path(), &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let names = ["R", "G", "B"];
    let image = prpf::image::exr_file::read_channels(&folder.path().join("crop.exr"), &names).unwrap();
    let reference: PathBuf = scene.with_file_name("reference").join("TungstenRender.exr");
    let whole = prpf::image::exr_file::read_channels(&reference, &names).unwrap();
    let mut part = prpf::image::Planes::new(256, 256, 3);
    for c in 0..3 {
        for (i, v) in part.plane_mut(c).iter_mut().enumerate() {
            *v = whole.at(c, bounds[0] + i % 256, bounds[2] + i / 256);
        }
    }
    let pair = prpf::image::metrics::Pair::new(&image, &part).unwrap();
    assert!((pair.mean_ratio() - 1.0).abs() < 0.02, "{}", pair.mean_ratio());
    assert!(pair.block_relmse() < 0.01, "{}", pair.block_relmse());
}

#[test]
fn a_camera_file_that_is_wrong_is_named_with_its_line() {
    let folder = folder_with(SCENE);
    for (text, said) in [
        ("LookAt 0 0 0  0 0 1  0 1 0", "found no Camera"),
        ("LookAt 0 0 0\nCamera \"perspective\"", "camera.txt:2:1"),
        ("Camera \"perspective\"\nWorldBegin", "WorldBegin"),
        ("Camera \"perspective\"\nShape \"sphere\"", "camera.txt:2:1"),
    ] {
        std::fs::write(folder.path().join("camera.txt"), text).unwrap();
        let error =
            refused(folder.path(), &["render", "scene.pbrt", "--camera", "camera.txt", "-o", "a.exr"]);
        assert!(error.contains("camera.txt") && error.contains(said), "{error}");
    }
    let error = refused(folder.path(), &["render", "scene.pbrt", "--camera", "none.txt", "-o", "a.exr"]);
    assert!(error.contains("none.txt"), "{error}");
}

#[test]
fn a_scene_does_not_write_outside_this_folder_without_being_asked() {
    let folder = folder_with(&SCENE.replace("named.exr", "../elsewhere/named.exr"));
    let here = folder.path().join("here");
    std::fs::create_dir(&here).unwrap();
    let output = prpf(&here, &["render", "../scene.pbrt", "--spp", "1"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("leads out of this folder"), "{}", stderr(&output));
    assert!(here.join("named.exr").exists());
}

#[test]
fn a_preview_refuses_a_report_and_its_help_names_none() {
    let folder = folder_with(SCENE);
    let error = refused(folder.path(), &["preview", "scene.pbrt", "--report", "a.json"]);
    assert!(error.contains("--report a.json") && error.contains("render --preview"), "{error}");
    let help = prpf(folder.path(), &["preview", "--help"]);
    assert!(!String::from_utf8_lossy(&help.stdout).contains("--report"));
}
