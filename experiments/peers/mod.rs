//! Puts images of other renderers and denoisers side by side: one HTML page that opens from a file without a server.
//!
//! Takes a folder with a folder for each scene. A scene has `reference.exr` (or `.png`) and images of the same size, EXR or
//! PNG, each named after the program that made it; times come from `times.csv` (lines `image name,seconds`) or from an
//! EXR's attribute `renderTimeSeconds`. Writes `peers.html` into the folder.

mod page;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use prpf::image::exr_file::{self, Attribute, attribute_names};
use prpf::image::metrics::Pair;
use prpf::image::tone::to_srgb8;
use prpf::image::{Comparison, Planes, png_file, read_rgb};

/// Name of the page.
const PAGE: &str = "peers.html";

/// A scene with its images.
#[derive(serde::Serialize)]
pub struct Scene {
    name: String,
    width: usize,
    height: usize,
    /// PNG in base64.
    reference: String,
    peers: Vec<Peer>,
}

/// An image of a scene, and its errors.
#[derive(serde::Serialize)]
pub struct Peer {
    name: String,
    seconds: Option<f64>,
    relmse: f64,
    psnr: f64,
    ssim: f64,
    flip: f64,
    mean_ratio: f64,
    /// PNGs in base64: the image, its FLIP map, its relative squared error.
    image: String,
    flip_map: String,
    error_map: String,
}

/// Makes the page of a folder. Returns its path.
///
/// # Errors
/// A folder without scenes, a scene without a reference or images, images of another size than their reference, times that
/// are no numbers.
pub fn write_page(folder: &Path) -> anyhow::Result<PathBuf> {
    let mut folders = entries(folder)?;
    folders.retain(|path| path.is_dir());
    ensure!(
        !folders.is_empty(),
        "{}: found no folders; accepted is a folder for each scene, with reference.exr and images",
        folder.display()
    );
    let scenes = folders.iter().map(|path| read_scene(path)).collect::<anyhow::Result<Vec<_>>>()?;
    let path = folder.join(PAGE);
    let text = page::html(&scenes)?;
    prpf::files::replace_file(&path, |out| std::io::Write::write_all(out, text.as_bytes()))
        .with_context(|| path.display().to_string())?;
    Ok(path)
}

fn entries(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let read = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut paths = read.map(|entry| Ok(entry?.path())).collect::<anyhow::Result<Vec<_>>>()?;
    paths.sort();
    Ok(paths)
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn read_scene(folder: &Path) -> anyhow::Result<Scene> {
    // Find the images
    let is_image = |path: &PathBuf| {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        path.is_file() && (extension == "exr" || extension == "png")
    };
    let (references, images): (Vec<_>, Vec<_>) =
        entries(folder)?.into_iter().filter(is_image).partition(|path| stem(path) == "reference");
    let [reference_path] = references.as_slice() else {
        bail!(
            "{}: found {} references; accepted is one, reference.exr or .png",
            folder.display(),
            references.len()
        );
    };
    ensure!(
        !images.is_empty(),
        "{}: found no images beside the reference; accepted are EXR and PNG",
        folder.display()
    );

    // Compare them
    let times = read_times(&folder.join("times.csv"))?;
    let reference = read_rgb(reference_path)?;
    let peer = |path: &PathBuf| -> anyhow::Result<Peer> {
        let image = read_rgb(path)?;
        let pair = Pair::new(&image, &reference).with_context(|| path.display().to_string())?;
        let comparison = Comparison::new(&pair);
        let (width, height) = (image.width(), image.height());
        Ok(Peer {
            name: stem(path),
            seconds: times.get(&stem(path)).copied().or_else(|| render_time(path)),
            relmse: comparison.relmse,
            psnr: comparison.psnr,
            ssim: comparison.ssim,
            flip: comparison.flip,
            mean_ratio: comparison.mean_ratio,
            image: png(width, height, &to_srgb8(&image, 0.0))?,
            flip_map: png(width, height, &comparison.flip_map.colours())?,
            error_map: png(width, height, &error_map(&image, &reference))?,
        })
    };
    let peers = images.iter().map(peer).collect::<anyhow::Result<Vec<_>>>()?;
    let (width, height) = (reference.width(), reference.height());
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Scene { name, width, height, reference: png(width, height, &to_srgb8(&reference, 0.0))?, peers })
}

/// Reads lines `image name,seconds`; no file is no times.
fn read_times(path: &Path) -> anyhow::Result<BTreeMap<String, f64>> {
    let mut times = BTreeMap::new();
    if !path.exists() {
        return Ok(times);
    }
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_path(path)?;
    for (line, record) in reader.records().enumerate() {
        let record = record.with_context(|| path.display().to_string())?;
        let seconds = record.get(1).and_then(|text| text.parse::<f64>().ok());
        let Some(seconds) =
            seconds.filter(|seconds| seconds.is_finite() && *seconds >= 0.0 && record.len() == 2)
        else {
            let found = record.iter().collect::<Vec<_>>().join(",");
            bail!(
                "{}:{}: found `{found}`; accepted is the name of an image and seconds",
                path.display(),
                line + 1
            );
        };
        times.insert(record[0].to_owned(), seconds);
    }
    Ok(times)
}

/// Returns the render time that an EXR states.
fn render_time(path: &Path) -> Option<f64> {
    let attributes = exr_file::read_info(path).ok()?.attributes;
    attributes.into_iter().find_map(|(name, value)| match value {
        Attribute::Float(seconds) if name == attribute_names::RENDER_TIME_SECONDS => Some(f64::from(seconds)),
        _ => None,
    })
}

/// Draws the squared error relative to the reference's squared brightness, mean over the channels: red where the image is
/// too bright, blue where it is too dark, full at a relative error of 1.
fn error_map(image: &Planes, reference: &Planes) -> Vec<u8> {
    let pixel = |i: usize| {
        let [x, r] = [image, reference].map(|planes| planes.channel_mean(i));
        let relative = (x - r) / (r * r + 0.01).sqrt();
        let strength = (255.0 * relative.abs().sqrt().min(1.0)) as u8;
        if relative > 0.0 { [strength, strength / 4, 0] } else { [0, strength / 4, strength] }
    };
    (0..image.pixels()).flat_map(pixel).collect()
}

/// Encodes interleaved 8-bit RGB as a PNG in base64.
fn png(width: usize, height: usize, rgb: &[u8]) -> anyhow::Result<String> {
    Ok(base64(&png_file::encode(width, height, rgb)?))
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let bits = (0..3).fold(0, |bits, k| bits << 8 | u32::from(chunk.get(k).copied().unwrap_or(0)));
        for k in 0..4 {
            let letter = ALPHABET[(bits >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= chunk.len() { letter.into() } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(width: usize, value: f32) -> Planes {
        let mut planes = Planes::new(width, 20, 3);
        planes.data_mut().fill(value);
        planes
    }

    #[test]
    fn base64_is_that_of_the_standard() {
        for (bytes, text) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn a_page_holds_all_scenes_and_images() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("grey <room>");
        std::fs::create_dir(&scene).unwrap();
        for (name, value) in [("reference", 0.5), ("fast", 0.6), ("slow", 0.5)] {
            png_file::write(&scene.join(format!("{name}.png")), &grey(20, value), 0.0).unwrap();
        }
        std::fs::write(scene.join("times.csv"), "fast, 1.5\n").unwrap();
        let page = std::fs::read_to_string(write_page(folder.path()).unwrap()).unwrap();
        assert!(page.contains("\"name\":\"fast\",\"seconds\":1.5") && page.contains("\"name\":\"slow\""));
        assert!(
            page.contains("grey \\u003croom>") && !page.contains("grey <room>"),
            "no name ends the script"
        );
        assert!(!page.contains("src=\"http") && !page.contains("href=\"http"), "it needs no server");
    }

    #[test]
    fn folders_that_are_no_comparison_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let error = || format!("{:#}", write_page(folder.path()).unwrap_err());
        assert!(error().contains("found no folders"));
        let scene = folder.path().join("scene");
        std::fs::create_dir(&scene).unwrap();
        assert!(error().contains("found 0 references"));
        png_file::write(&scene.join("reference.png"), &grey(20, 0.5), 0.0).unwrap();
        assert!(error().contains("found no images"));
        png_file::write(&scene.join("other.png"), &grey(10, 0.5), 0.0).unwrap();
        assert!(error().contains("other.png: the sizes differ"));
        png_file::write(&scene.join("other.png"), &grey(20, 0.5), 0.0).unwrap();
        std::fs::write(scene.join("times.csv"), "other,soon\n").unwrap();
        assert!(error().contains("times.csv:1: found `other,soon`"));
    }
}
