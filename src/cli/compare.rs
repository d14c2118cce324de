//! `prpf compare`: errors of an image with respect to a reference.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;

use super::terminal;
use crate::image::metrics::{BLOCK_SIDE, Pair};
use crate::image::{Comparison, OutputFormat, read_rgb};
use crate::image::{Planes, Problem, exr_file, png_file};
use crate::output::paths::{are_distinct, can_be_written};

/// Exit status when the images were compared and no limit was passed.
const WITHIN: u8 = 0;
/// Exit status when relMSE is above `--max-relmse`, or a pixel has no error.
const ABOVE: u8 = 1;

/// Compare an image with its reference: MSE, relMSE, PSNR, SSIM, FLIP, mean brightness
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  prpf compare out.exr reference.exr
  prpf compare out.exr reference.exr --layer Noisy  # the unfiltered mean
  prpf compare out.exr reference.exr --json --max-relmse 0.01
  prpf compare out.png reference.png --error-image flip.png

EXR values are linear; 8-bit files are taken for sRGB and made linear first.
Pixels that are NaN or infinite in either image are counted and left out.
Exit status: 0 compared, 1 above --max-relmse, or with it a pixel of IMAGE is NaN or infinite where
REFERENCE is not, 2 an image cannot be read, the sizes differ, or no pixel is finite in both.")]
pub(super) struct CompareOptions {
    /// The image: EXR, PNG, JPEG or TGA
    image: PathBuf,
    /// The reference, of the same size
    reference: PathBuf,
    /// Print one JSON object instead of text (an infinite number becomes null)
    #[arg(long)]
    json: bool,
    /// Write the FLIP map in magma colours: black is equal, pale yellow is far
    #[arg(long, value_name = "FILE.png")]
    error_image: Option<PathBuf>,
    /// Exit with status 1 when relMSE is above this
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    max_relmse: Option<f64>,
    /// Compare this layer of IMAGE (an EXR), such as Noisy or Albedo, instead of its image
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
}

fn parse_limit(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(limit) if limit >= 0.0 => Ok(limit),
        _ => Err(format!("found `{text}`; accepted are numbers from 0")),
    }
}

/// Compares, prints, and returns the exit status.
///
/// # Errors
/// Bad input (exit status 2).
pub(super) fn run(options: &CompareOptions) -> anyhow::Result<u8> {
    // Read the images
    if let Some(path) = &options.error_image {
        let is_png = OutputFormat::from_path(path).is_ok_and(|format| format == OutputFormat::Png);
        ensure!(is_png, "--error-image {}: unknown extension; accepted is .png", path.display());
        can_be_written(path)?;
        are_distinct([&*options.image, &*options.reference], &[path])?;
    }
    let image = read_image(&options.image, options.layer.as_deref())?;
    let reference = read_rgb(&options.reference)?;
    let pair = Pair::new(&image, &reference)
        .with_context(|| format!("{} and {}", options.image.display(), options.reference.display()))?;

    // Compare them
    let comparison = Comparison::new(&pair);
    if let Some(path) = &options.error_image {
        png_file::write_srgb8(path, image.width(), image.height(), &comparison.flip_map.colours())?;
    }

    // Print the comparison
    let output = if options.json {
        serde_json::to_string_pretty(&comparison)? + "\n"
    } else {
        table(&comparison, &pair)?
    };
    terminal::print(&output)?;
    let Some(problem) = options.max_relmse.and_then(|limit| problem(&comparison, &pair, limit)) else {
        return Ok(WITHIN);
    };
    terminal::print_error(&problem);
    Ok(ABOVE)
}

/// Returns why the image is worse than the limit on relMSE allows; `None` if it is not.
fn problem(comparison: &Comparison, pair: &Pair, limit: f64) -> Option<String> {
    let without_error = comparison.excluded_pixels - pair.reference_non_finite;
    if comparison.relmse > limit {
        Some(format!("relMSE {} is above the limit of {limit:?}", significant(comparison.relmse)))
    } else if without_error > 0 {
        Some(format!("pixels that are NaN or infinite where the reference is not: {without_error}"))
    } else {
        None
    }
}

fn read_image(path: &Path, layer: Option<&str>) -> anyhow::Result<Planes> {
    match layer {
        None => Ok(read_rgb(path)?),
        Some(layer) => exr_file::read_layer(path, Some(layer)).map_err(|error| match error.problem {
            Problem::Malformed(_) => anyhow::anyhow!("{error} (--layer needs an EXR file)"),
            _ => error.into(),
        }),
    }
}

/// A line for each metric, with its formula.
fn table(comparison: &Comparison, pair: &Pair) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    writeln!(text, "x: the image, r: the reference, <>: mean over pixels and channels")?;
    let block = format!("relmse after averaging both over {BLOCK_SIDE}x{BLOCK_SIDE} pixels");
    let lines = [
        ("mse", comparison.mse, "<(x - r)^2>, linear light"),
        ("relmse", comparison.relmse, "<(x - r)^2 / (r^2 + 0.01)>, linear light"),
        ("block_relmse", comparison.block_relmse, block.as_str()),
        ("psnr", comparison.psnr, "10 log10(1 / <(x - r)^2>) dB, sRGB-encoded and clamped to 0..1"),
        (
            "ssim",
            comparison.ssim,
            "image-compare's SSIM of 8-bit sRGB luma, 8x8 windows (stricter than Wang's); 1 is equal",
        ),
        ("flip", comparison.flip, "mean of LDR-FLIP, sRGB, 67 pixels per degree; 0 is equal"),
        ("mean_ratio", comparison.mean_ratio, "<x> / <r>, linear light"),
    ];
    for (name, value, formula) in lines {
        writeln!(text, "{name:<13}{:>12}   {formula}", significant(value))?;
    }
    if comparison.excluded_pixels > 0 {
        writeln!(
            text,
            "{} pixels are left out: {} of the image and {} of the reference are NaN or infinite",
            comparison.excluded_pixels, pair.image_non_finite, pair.reference_non_finite
        )?;
    }
    Ok(text)
}

/// Five significant digits, with an exponent where a plain number would hide them.
fn significant(value: f64) -> String {
    if value != 0.0 && value.is_finite() && !(1e-3..1e9).contains(&value.abs()) {
        format!("{value:.4e}")
    } else {
        format!("{value:.5}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        compare: CompareOptions,
    }

    /// An image and its reference on disk.
    struct Files {
        folder: tempfile::TempDir,
    }

    impl Files {
        fn new(image: &Planes, reference: &Planes) -> Self {
            let files = Self { folder: tempfile::tempdir().unwrap() };
            for (name, planes) in [("image.exr", image), ("reference.exr", reference)] {
                let channels: Vec<_> = ["R", "G", "B", "Noisy.R", "Noisy.G", "Noisy.B"]
                    .into_iter()
                    .zip(0..planes.count())
                    .map(|(name, i)| {
                        exr_file::Channel::new(name, planes.plane(i), exr_file::Precision::Float)
                    })
                    .collect();
                let windows = exr_file::Windows::whole(planes.width(), planes.height());
                exr_file::write(&files.path(name), windows, &channels, &[]).unwrap();
            }
            files
        }

        fn path(&self, name: &str) -> PathBuf {
            self.folder.path().join(name)
        }

        fn run(&self, options: &[&str]) -> anyhow::Result<u8> {
            let (image, reference) = (self.path("image.exr"), self.path("reference.exr"));
            let files = [image.as_os_str(), reference.as_os_str()];
            let arguments = std::iter::once("compare".as_ref()).chain(files);
            let cli = Cli::try_parse_from(arguments.chain(options.iter().map(|o| o.as_ref())))?;
            run(&cli.compare)
        }
    }

    fn filled(width: usize, height: usize, values: &[f32]) -> Planes {
        let mut planes = Planes::new(width, height, values.len());
        for (plane, value) in planes.planes_mut().zip(values) {
            plane.fill(*value);
        }
        planes
    }

    #[test]
    fn the_limit_on_relmse_decides_the_exit_status() {
        // (0.5 - 0.25)^2 / (0.25^2 + 0.01) = 0.862
        let files = Files::new(&filled(4, 4, &[0.5; 3]), &filled(4, 4, &[0.25; 3]));
        assert_eq!(files.run(&[]).unwrap(), 0);
        assert_eq!(files.run(&["--max-relmse", "0.87"]).unwrap(), 0);
        assert_eq!(files.run(&["--max-relmse", "0.85", "--json"]).unwrap(), 1);
        for limit in ["nan", "-1", "x"] {
            assert!(files.run(&[&format!("--max-relmse={limit}")]).is_err());
        }
    }

    #[test]
    fn no_limit_admits_pixels_without_an_error() {
        let reference = filled(4, 4, &[0.5; 3]);
        let mut image = reference.clone();
        image.plane_mut(1)[5] = f32::NAN;
        let exit_status = |image: &Planes, reference: &Planes, options: &[&str]| {
            Files::new(image, reference).run(options).unwrap()
        };
        assert_eq!(exit_status(&image, &reference, &[]), 0);
        assert_eq!(exit_status(&image, &reference, &["--max-relmse", "9"]), 1);
        assert_eq!(exit_status(&image, &image, &["--max-relmse", "9"]), 0, "the reference has none either");
    }

    #[test]
    fn another_layer_is_compared_with_the_references_image() {
        let image = filled(4, 4, &[0.5, 0.5, 0.5, 0.25, 0.25, 0.25]);
        let files = Files::new(&image, &filled(4, 4, &[0.25; 3]));
        assert_eq!(files.run(&["--layer", "Noisy", "--max-relmse", "0"]).unwrap(), 0);
        assert_eq!(files.run(&["--max-relmse", "0"]).unwrap(), 1);
        let message = files.run(&["--layer", "Albedo"]).unwrap_err().to_string();
        assert!(
            message.contains("channels Albedo.R, Albedo.G, Albedo.B are missing; the file has B, G"),
            "{message}"
        );
    }

    #[test]
    fn other_sizes_are_one_clear_line() {
        let files = Files::new(&filled(4, 4, &[0.5; 3]), &filled(4, 5, &[0.5; 3]));
        let message = format!("{:#}", files.run(&[]).unwrap_err());
        assert!(message.ends_with("the sizes differ: the image is 4x4, the reference is 4x5"), "{message}");
        assert_eq!(message.lines().count(), 1);
    }

    #[test]
    fn a_missing_file_is_one_clear_line() {
        let files = Files::new(&filled(4, 4, &[0.5; 3]), &filled(4, 4, &[0.5; 3]));
        std::fs::remove_file(files.path("reference.exr")).unwrap();
        let message = format!("{:#}", files.run(&[]).unwrap_err());
        assert_eq!(message, format!("{}: no such file or folder", files.path("reference.exr").display()));
    }

    #[test]
    fn the_error_image_has_the_images_size_and_must_be_a_png() {
        let files = Files::new(&filled(5, 4, &[0.9; 3]), &filled(5, 4, &[0.1; 3]));
        let path = files.path("flip.png");
        files.run(&["--error-image", path.to_str().unwrap()]).unwrap();
        let map = png_file::read(&path).unwrap();
        assert_eq!((map.width(), map.height()), (5, 4));
        assert!(map.at(0, 2, 2) > 0.5, "a large difference is bright");
        assert!(files.run(&["--error-image", "flip.exr"]).is_err());
        let (a, b) = (files.path("a.png"), files.path("b.png"));
        png_file::write_srgb8(&a, 1, 1, &[0; 3]).unwrap();
        std::fs::copy(&a, &b).unwrap();
        let before = std::fs::read(&a).unwrap();
        for kept in [&a, &b] {
            let options = CompareOptions {
                image: a.clone(),
                reference: b.clone(),
                json: false,
                error_image: Some(kept.clone()),
                max_relmse: None,
                layer: None,
            };
            assert!(run(&options).unwrap_err().to_string().contains("the same file twice"));
            assert!(std::fs::read(kept).unwrap() == before);
        }
    }

    #[test]
    fn json_has_the_promised_keys_and_no_infinity() {
        let (image, reference) = (filled(4, 4, &[0.5; 3]), filled(4, 4, &[0.5; 3]));
        let pair = Pair::new(&image, &reference).unwrap();
        let comparison = Comparison::new(&pair);
        let json = serde_json::to_value(&comparison).unwrap();
        for (key, value) in [("mse", 0.0), ("relmse", 0.0), ("ssim", 1.0), ("flip", 0.0), ("mean_ratio", 1.0)]
        {
            assert_eq!(json[key], value, "{key}");
        }
        assert!(json["psnr"].is_null());
    }

    #[test]
    fn small_numbers_keep_their_digits() {
        assert_eq!(significant(0.000_012_345), "1.2345e-5");
        assert_eq!(significant(0.5), "0.50000");
        assert_eq!(significant(0.0), "0.00000");
        assert_eq!(significant(f64::INFINITY), "inf");
    }
}
