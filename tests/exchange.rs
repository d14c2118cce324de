//! Files that are exchanged with other programs, as a user does it: sample maps, images of other renderers, and single samples.

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

/// Two noisy images of a step from 0.2 to 1, and a value for each pixel and channel that is its noise-free half.
fn images(folder: &Path) -> Vec<f32> {
    let clean: Vec<f32> =
        (0..WIDTH * HEIGHT).map(|i| if i % WIDTH < WIDTH / 2 { 0.2 } else { 1.0 }).collect();
    let normal: Vec<f32> = clean.iter().map(|&v| if v < 0.5 { 1.0 } else { 0.0 }).collect();
    let rest: Vec<f32> = normal.iter().map(|v| 1.0 - v).collect();
    let zero = vec![0.0; WIDTH * HEIGHT];
    for (name, seed) in [("a.exr", 1u32), ("b.exr", 2)] {
        let noise =
            |i: usize| ((i as u32 ^ seed << 20).wrapping_mul(0x9e37_79b9) >> 16) as f32 / 32768.0 - 1.0;
        let noisy: Vec<f32> = clean.iter().enumerate().map(|(i, v)| v * (1.0 + 0.4 * noise(i))).collect();
        let [key, fill] = [0.75, 0.25].map(|part| noisy.iter().map(|v| part * v).collect::<Vec<_>>());
        let mut channels: Vec<(String, &[f32])> = Vec::new();
        for (c, suffix) in ["R", "G", "B"].into_iter().enumerate() {
            channels.push((suffix.to_owned(), &noisy));
            channels.push((format!("key.{suffix}"), &key));
            channels.push((format!("fill.{suffix}"), &fill));
            let axis = [&normal, &rest, &zero][c];
            channels.push((format!("Ns.{}", ["X", "Y", "Z"][c]), axis));
        }
        let channels: Vec<(&str, &[f32])> =
            channels.iter().map(|(name, values)| (name.as_str(), *values)).collect();
        write(&folder.join(name), &channels);
    }
    clean
}

#[test]
fn two_images_are_denoised_and_their_layers_with_them() {
    let folder = folder();
    let clean = images(folder.path());
    for denoiser in ["learned", "nlm"] {
        denoise_with_layers(folder.path(), &clean, denoiser);
    }
}

/// Denoises two images and their layers; checks both.
fn denoise_with_layers(folder: &Path, clean: &[f32], denoiser: &str) {
    let inputs = ["denoise", "a.exr", "b.exr", "--aovs", "key,fill", "--denoiser", denoiser];
    let output = prpf(folder, &[&inputs, &["-o", "out.exr", "-o", "out.png"][..]].concat());
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(
        said.contains("a.exr: colour (no name), normal Ns\n") && said.contains("estimated relMSE"),
        "{said}"
    );
    assert!(folder.join("out.png").exists());
    let read = |names: &[&str]| exr_file::read_channels(&folder.join("out.exr"), names).unwrap();
    let error = |image: &[f32]| image.iter().zip(clean).map(|(v, c)| ((v - c) / c).powi(2)).sum::<f32>();
    let planes = read(&["G", "Noisy.G", "key.G", "fill.G"]);
    let (filtered, noisy) = (error(planes.plane(0)), error(planes.plane(1)));
    assert!(filtered < 0.3 * noisy, "{filtered} {noisy}");
    for (i, v) in planes.plane(0).iter().enumerate() {
        let [key, fill] = [2, 3].map(|c| planes.plane(c)[i]);
        assert!((key + fill - v).abs() <= 1e-5 * v && (key / v - 0.75).abs() < 1e-3, "{key} {fill} {v}");
    }
}

#[test]
fn parts_and_tiles_are_read() {
    use exr::prelude::*;
    let folder = folder();
    images(folder.path());
    let size = (WIDTH, HEIGHT);
    for name in ["a.exr", "b.exr"] {
        let read = |names: &[&str]| exr_file::read_channels(&folder.path().join(name), names).unwrap();
        let (colour, normal) = (read(&["R", "G", "B"]), read(&["Ns.X", "Ns.Y", "Ns.Z"]));
        let layer = |name: &str, suffixes: [&str; 3], planes: &prpf::image::Planes, bounds: IntegerBounds| {
            let channels = suffixes.iter().enumerate().map(|(c, suffix)| {
                let values = planes.plane(c).iter().map(|&v| f16::from_f32(v)).collect();
                AnyChannel::new(format!("View.{name}.{suffix}").as_str(), FlatSamples::F16(values))
            });
            let encoding = Encoding { blocks: Blocks::Tiles(Vec2(16, 16)), ..Encoding::FAST_LOSSLESS };
            let attributes =
                LayerAttributes::named(format!("View.{name}").as_str()).with_position(bounds.position);
            Layer::new(size, attributes, encoding, AnyChannels::sort(channels.collect()))
        };
        let at = |x, y| IntegerBounds::new((x, y), size);
        let layers = vec![
            layer("Combined", ["R", "G", "B"], &colour, at(4, 2)),
            layer("Denoising Normal", ["X", "Y", "Z"], &normal, at(4, 2)),
        ];
        let window = ImageAttributes::new(IntegerBounds::new((0, 0), (WIDTH + 9, HEIGHT + 9)));
        let image = Image::from_layers(window, layers);
        image.write().to_file(folder.path().join(format!("parts-{name}"))).unwrap();
    }
    let output = prpf(folder.path(), &["denoise", "parts-a.exr", "parts-b.exr", "-o", "out.exr"]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        said.contains("colour View.Combined, normal View.Denoising Normal"),
        "{said} {:?}",
        output.stderr
    );
    let info = exr_file::read_info(&folder.path().join("out.exr")).unwrap();
    let [width, height] = [WIDTH, HEIGHT].map(|side| side as i32);
    let windows = Windows { data: [4, 4 + width, 2, 2 + height], display: [0, width + 9, 0, height + 9] };
    assert_eq!(info.windows, windows);
}

#[test]
fn images_that_cannot_be_denoised_get_one_line() {
    let folder = folder();
    images(folder.path());
    let refused = |more: &[&str]| refused(folder.path(), &[&["denoise"], more].concat());
    let out = ["-o", "out.exr"];
    let with_out = |more: &[&str]| refused(&[more, &out[..]].concat());
    assert!(refused(&["a.exr", "b.exr"]).contains("-o FILE.exr"));
    assert!(with_out(&["a.exr"]).contains("without a variance"));
    assert!(with_out(&["a.exr", "a.exr"]).contains("another seed"));
    assert!(
        with_out(&["a.exr", "scene.pbrt"])
            .contains("scene.pbrt: the image is not supported: the file is not an EXR")
    );
    assert!(
        with_out(&["a.exr", "b.exr", "--map", "albedo=skin"])
            .contains("found no layer `skin`; accepted are ``, `Ns`")
    );
    assert!(with_out(&["a.exr", "b.exr", "--map", "skin=a"]).contains("--map"));
    assert!(
        with_out(&["a.exr", "b.exr", "--aovs", "key"]).contains("--aovs: found layers whose sum differs")
    );
    assert!(
        with_out(&["a.exr", "b.exr", "--aovs", "key,fill", "--denoiser", "none"])
            .contains("accepted are learned, nlm")
    );
    assert!(with_out(&["a.exr", "b.exr", "--denoiser", "prpf"]).contains("sample vectors"));
    assert!(with_out(&["a.exr", "b.exr", "--aovs", "Noisy"]).contains("--aovs Noisy: found"));
    assert!(with_out(&["scene.pbrt", "--map", "albedo=a"]).contains("no EXR image"));
    assert!(with_out(&["a.exr", "b.exr", "--layers", "P"]).contains("accepted with images are Noisy"));
    let png = ["a.exr", "b.exr", "--aovs", "key,fill", "-o", "out.png"];
    assert!(refused(&png).contains("--aovs: found no output that has layers"));
    let values = vec![1.0; WIDTH * HEIGHT];
    write(&folder.path().join("grey.exr"), &[("Y", &values)]);
    assert!(with_out(&["grey.exr", "a.exr"]).contains("found no colour among the layers ``"));
}

#[test]
fn alpha_is_the_mean_of_both() {
    let folder = folder();
    images(folder.path());
    let read =
        |name: &str, channels: &[&str]| exr_file::read_channels(&folder.path().join(name), channels).unwrap();
    for (name, alpha) in [("a.exr", 0.5), ("b.exr", 0.25)] {
        let (colour, alpha) = (read(name, &["R"]), vec![alpha; WIDTH * HEIGHT]);
        let values = colour.plane(0);
        write(&folder.path().join(name), &[("R", values), ("G", values), ("B", values), ("A", &alpha)]);
    }
    let output = prpf(folder.path(), &["denoise", "a.exr", "b.exr", "-o", "out.exr"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(read("out.exr", &["A"]).data().iter().all(|&alpha| alpha == 0.375));
}

/// A file of samples: the names of its fields, and the values of each sample, those of `u4` fields as numbers.
fn read_samples(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    use std::io::Read;
    let mut archive = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    let (mut fields, mut samples) = (Vec::new(), Vec::new());
    for piece in 0..archive.len() {
        let mut file = archive.by_index(piece).unwrap();
        assert_eq!(file.name().unwrap(), format!("samples_{piece:06}.npy"));
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let header = String::from_utf8(bytes[10..start].to_vec()).unwrap();
        let list = header.split_once('[').unwrap().1.split_once(']').unwrap().0;
        let kinds: Vec<(String, bool)> = list
            .split("), ")
            .filter_map(|field| field.trim_start_matches('(').split_once(", "))
            .map(|(name, kind)| (name.trim_matches('\'').to_owned(), kind.contains("u4")))
            .collect();
        for record in bytes[start..].chunks_exact(4 * kinds.len()) {
            let values =
                record.as_chunks().0.iter().zip(&kinds).map(|(bytes, (_, is_integer))| match is_integer {
                    true => f64::from(u32::from_le_bytes(*bytes)),
                    false => f64::from(f32::from_le_bytes(*bytes)),
                });
            samples.push(values.collect());
        }
        fields = kinds.into_iter().map(|(name, _)| name).collect();
    }
    (fields, samples)
}

#[test]
fn every_sample_is_written() {
    let folder = folder();
    let options = ["--samples", "all.npz", "--spp", "24", "--threads"];
    let render = |threads: &str| {
        let arguments = [&["render", "scene.pbrt", "-o", "out.exr"], &options[..], &[threads]].concat();
        let output = prpf(folder.path(), &arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        let path = folder.path().join("all.npz");
        let (fields, mut samples) = read_samples(&path);
        samples.sort_by(|a, b| a[..3].iter().rev().partial_cmp(b[..3].iter().rev()).unwrap());
        (said, fields, samples, path.metadata().unwrap().len() as usize)
    };
    let (said, fields, samples, bytes) = render("2");
    assert!(render("1").2 == samples, "threads make no difference");
    assert_eq!(fields[..6], ["x", "y", "index", "film.x", "film.y", "R"]);
    let predicted = 24 * WIDTH * HEIGHT;
    assert_eq!(samples.len(), predicted);
    assert!(said.contains(&format!("({predicted} samples of {} bytes)", 4 * fields.len())), "{said}");
    assert!(bytes > predicted * 4 * fields.len() && bytes < predicted * 4 * fields.len() + 40_000);

    // Counts and means are those of the image
    let radiance = fields.iter().position(|name| name == "radiance.r").unwrap_or(5);
    let (mut counts, mut sums) = (vec![0.0; WIDTH * HEIGHT], vec![0.0; WIDTH * HEIGHT]);
    for sample in &samples {
        let (x, y) = (sample[0] as usize, sample[1] as usize);
        assert!((sample[3] - sample[0] - 0.5).abs() < 4.0 && sample[2] == counts[y * WIDTH + x]);
        counts[y * WIDTH + x] += 1.0;
        sums[y * WIDTH + x] += sample[radiance];
    }
    let planes =
        exr_file::read_channels(&folder.path().join("out.exr"), &["SampleCount.X", "Noisy.R"]).unwrap();
    for i in 0..WIDTH * HEIGHT {
        assert_eq!(f64::from(planes.plane(0)[i]), counts[i]);
        assert!((f64::from(planes.plane(1)[i]) - sums[i] / counts[i]).abs() < 1e-5);
    }

    // A file of single samples is refused where the camera may move, and under another name
    let refused = |more: &[&str]| refused(folder.path(), more);
    assert!(refused(&["preview", "scene.pbrt", "--samples", "all.npz"]).contains("--samples"));
    assert!(refused(&["render", "scene.pbrt", "--samples", "all.zarr"]).contains("accepted is .npz"));
}
