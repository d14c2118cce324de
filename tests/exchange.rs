//! Files that are exchanged with other programs, as a user does it: sample maps.

mod command;

use std::path::Path;

use command::{prpf, refused};
use prpf::image::exr_file::{self, Channel, Precision, Windows};

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

const WIDTH: usize = 24;
const HEIGHT: usize = 16;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).expect("a file in it");
    folder
}

/// Writes channels of an image of the scene's size.
fn write(path: &Path, channels: &[(&str, &[f32])]) {
    let channels: Vec<_> =
        channels.iter().map(|(name, values)| Channel::new(*name, values, Precision::Float)).collect();
    exr_file::write(path, Windows::whole(WIDTH, HEIGHT), &channels, &[]).expect("it is written");
}

/// Renders with these options and returns the layer `SampleCount`.
fn sample_counts(folder: &Path, options: &[&str]) -> Vec<f32> {
    let arguments = [&["render", "scene.pbrt", "-o", "out.exr", "--quiet"], options].concat();
    let output = prpf(folder, &arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    exr_file::read_channels(&folder.join("out.exr"), &["SampleCount.X"]).unwrap().into_data()
}

#[test]
fn a_sample_map_places_the_samples() {
    let folder = folder();
    let ratios: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| (i % WIDTH) as f32 / 4.0).collect();
    write(&folder.path().join("ratios.exr"), &[("Y", &ratios)]);

    // Ratios: the mean is that of the budget
    let counts = sample_counts(folder.path(), &["--sample-map", "ratios.exr", "--spp", "23"]);
    assert_eq!(counts.iter().sum::<f32>(), (23 * WIDTH * HEIGHT) as f32);
    assert!(counts.iter().zip(&ratios).all(|(n, ratio)| (n - 8.0 * ratio).abs() <= 3.0), "{counts:?}");

    // Ratios under a time budget: some multiple of the map
    let counts =
        sample_counts(folder.path(), &["--sample-map", "ratios.exr", "--spp", "0", "--time", "700ms"]);
    let scale = counts.iter().sum::<f32>() / ratios.iter().sum::<f32>();
    let is_near = |(n, ratio): (&f32, &f32)| (n - scale * ratio).abs() <= 0.15 * scale * ratio + 8.0;
    assert!(scale > 1.0 && counts.iter().zip(&ratios).all(is_near), "{scale} {counts:?}");

    // Counts, in two runs
    let numbers: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| (i % 7) as f32).collect();
    write(&folder.path().join("counts.exr"), &[("R", &numbers), ("G", &numbers), ("B", &numbers)]);
    let absolute = ["--sample-map", "counts.exr", "--sample-map-values", "absolute", "--report", "out.json"];
    let state = ["--state", "out.state"];
    assert_eq!(sample_counts(folder.path(), &[&absolute[..], &state[..]].concat()), numbers);
    let report = std::fs::read(folder.path().join("out.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["settings"]["sample_map"], "absolute");
    assert_eq!(report["stopped_by"], "spp");
    let more: Vec<f32> = numbers.iter().map(|n| 2.0 * n + 3.0).collect();
    write(&folder.path().join("counts.exr"), &[("N", &more)]);
    assert_eq!(sample_counts(folder.path(), &[&absolute[..], &state[..], &["--resume"]].concat()), more);
}

#[test]
fn a_map_that_places_no_samples_is_refused() {
    let folder = folder();
    let refused = |values: &[f32], more: &[&str]| {
        write(&folder.path().join("map.exr"), &[("Y", values)]);
        refused(folder.path(), &[&["render", "scene.pbrt", "--sample-map", "map.exr"], more].concat())
    };
    let mut values = vec![1.0; WIDTH * HEIGHT];
    assert!(refused(&values, &["--sampling", "adaptive"]).contains("--sampling adaptive"));
    assert!(refused(&values, &["--spp", "4", "--sample-map-values", "absolute"]).contains("--spp 4"));
    assert!(refused(&values, &["--resolution", "8x8"]).contains("found a sample map of 24x16"));
    assert!(refused(&vec![0.0; WIDTH * HEIGHT], &[]).contains("found no pixel"));
    for value in [-1.0, f32::NAN] {
        values[5] = value;
        let line = refused(&values, &[]);
        assert!(line.contains(&format!("map.exr: the sample map: found {value} at pixel 5")), "{line}");
    }
}
